"""Rational functions fitted to complex responses."""
