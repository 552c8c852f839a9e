"""Covers of sets of matrix responses: a nominal with weights on both sides of one Delta."""
