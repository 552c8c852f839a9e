"""Robust controllers, their margins, and bounds that no controller beats."""
