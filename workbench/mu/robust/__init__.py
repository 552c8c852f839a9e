"""Robustness of loops: conditions, worst cases, skewed mu, branch and bound.

Robust performance is robust stability with a full complex block more (main loop theorem).
"""
