"""Limits of covers: how small their sets can be at given orders."""
