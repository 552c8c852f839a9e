"""Mu synthesis: D-K, (mu, D)-K and (D, G)-K iteration, and fixed structures.

Each ends in a local optimum, whose peak of mixed mu is proven. `synthesis.limits` has bounds that
no controller can beat.
"""
