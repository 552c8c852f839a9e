"""Proofs of bounds: results of a search, stored so that they can be checked again."""
