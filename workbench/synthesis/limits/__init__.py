"""Bounds on robust performance that hold for every stabilising controller.

The least mu over all complex K at a frequency, and dual integrals over frequency that no analytic
function can beat.
"""
