"""Nominal and weights that contain measured responses: circles and stadiums."""
