"""Enclosures of quantities of a realisation: Gramians, Hankel singular values, parts of a sum."""
