"""Local minimisation of nonsmooth functions that are infinite outside a set, and a measure of
stationarity at its end.
"""
