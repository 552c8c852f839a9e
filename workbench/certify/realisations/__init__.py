"""Enclosures of what belongs to a realisation: Gramians, Hankel values, parts of a sum."""
