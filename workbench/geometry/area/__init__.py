"""Stadiums of the smallest area around sets of complex points."""

from workbench.geometry.area.program import SmallestAreaStadium, smallest_area_stadium

__all__ = ["SmallestAreaStadium", "smallest_area_stadium"]
