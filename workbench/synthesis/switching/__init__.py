"""Stability of loops that switch: dwell times, and sets of transitions.

Each mode has a quadratic function. Linear matrix inequalities make these functions decrease from
switching to switching. An unstable periodic switching bounds the dwell time from below.
"""
