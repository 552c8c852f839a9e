"""Sizes of the sets of a cover, compared with the smallest sets around the points."""
