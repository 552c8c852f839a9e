"""Polynomial models of a record: FIR, ARX, ARMAX, output error, Box-Jenkins."""
