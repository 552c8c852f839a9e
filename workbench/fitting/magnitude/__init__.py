"""Rational functions fitted to magnitudes, also as covers."""
