"""Nominal and weights of a cover chosen together, for the smallest sets of the model."""
