"""Bounds of mu over frequency, and the peak over all frequencies.

For fixed multipliers the bound holds around a grid point up to the nearest imaginary eigenvalue of
a Hamiltonian matrix. Such intervals cover the axis.
"""
