"""Largest distance of the focus point from the layer while a defect passes."""
