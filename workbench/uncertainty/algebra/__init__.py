"""Arithmetic and connection of uncertain systems."""
