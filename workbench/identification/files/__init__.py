"""Reading of users' files: columns of numbers with names and units.

`variables` chooses the reader by the ending of the file's name. Text such as CSV goes through
`encodings` (characters) and `text_table` (lines), which asks `layouts` for the separator, the
decimal mark and the marks of comments, and `heads` for the line of names and the row of units. The
result is `columns`. Its cells are read when they are used: `cells` reads numbers, `clocks` reads
dates, `names` finds the unit in a name, and `units` converts it.
"""
