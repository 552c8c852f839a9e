"""Rational models of measured responses, weighted by the variance, with confidence."""
