"""Margins of loops: classical ones, disks, and both over a set of plants.

Crossings are isolated exactly, and disks are bounded by the norm of (S - T) / 2 and its skewed
forms (Seiler, Packard and Gahinet, 2020).
"""
