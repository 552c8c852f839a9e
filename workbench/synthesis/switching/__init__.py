"""Stability of loops that switch: dwell times, and sets of transitions.

Quadratic functions for each mode, which linear matrix inequalities make decrease between
switchings; an unstable periodic switching bounds the dwell time from below.
"""
