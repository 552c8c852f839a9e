"""Nominal and weights that contain measured responses: circles and stadiums.

At each frequency the smallest set around the nominal is computed. Weights of a given order are
minimax fits above its sizes. A local search optimises nominal and weights together.
"""
