"""The ground of every room: arrays, compilation, remembered results, imports on demand, tables.

Takes: arrays, functions, and names of modules.
Gives: types of arrays, compiled functions, results kept in memory, and tables as text.
Rests on: no other room; no theorem is needed.
"""
