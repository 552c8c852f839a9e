"""Parametric uncertainty as a linear fractional transformation."""
