"""Bounds on robust performance that hold for every stabilising controller.

One bound is the least mu over all complex K(j omega) at a frequency. Another one is an integral
over all frequencies that limits every analytic closed loop.
"""
