"""Stability of loops that switch: dwell times, and sets of transitions."""
