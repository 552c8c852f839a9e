"""Several excitations of a coil and estimators of its response, with equal duration
and amplitude.
"""
