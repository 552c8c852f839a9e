"""Loops of one channel in exact arithmetic: crossings, exact dead time, distances from -1."""
