"""Covers of sets of matrix responses, each a nominal with weights on both sides of one Delta."""
