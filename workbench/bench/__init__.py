"""Named problems: how they are registered, run, stored, verified, compared and reported.

Takes: the name of a problem, its parameters and a method.
Gives: a folder with question, arrays, certificate and checksums, which anybody can verify.
Rests on: SHA-256; two questions with the same key are the same question.
"""

# Where to look:
#   declare, discovery, registry, problem, project   from a decorated function to a bound problem
#   question, run, checkpoint, notes                 what is asked, and how it is answered
#   store, results, files, netcdf, crate             folders that appear whole or not at all
#   verify                                           a folder checked from its arrays alone
#   cells, compare, comparison                       problems by methods by accuracy levels
#   describe, report                                 what people read
