"""Distortion of the loop, measured by a multisine and by sines of growing size."""
