"""Small problems of every kind of Program, each solved in seconds, on which methods
are compared.
"""
