"""Sums of the focus and of the radial diodes while the lens moves far through the focus."""
