"""Nominal and weights that contain measured responses: circles and stadiums.

At each frequency the smallest set about the nominal is known; weights of an order are minimax fits
above the sizes. Nominal and weights together are a local search.
"""
