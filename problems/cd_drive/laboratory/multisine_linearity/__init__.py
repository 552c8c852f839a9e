"""Distortion of the loop by a multisine, beside that by sines of growing size."""
