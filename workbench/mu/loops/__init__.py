"""Loops of one channel in exact arithmetic: crossings, dead time without approximation, distances
from -1.
"""
