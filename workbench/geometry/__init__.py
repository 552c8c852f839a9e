"""Smallest circles and narrowest stadiums around sets of complex points."""

from workbench.geometry import conic, nonlinear
from workbench.geometry.circle import Circle, SmallestCircle, smallest_circle
from workbench.geometry.stadium import NarrowestStadium, Stadium, narrowest_stadium

__all__ = [
    "Circle",
    "NarrowestStadium",
    "SmallestCircle",
    "Stadium",
    "conic",
    "narrowest_stadium",
    "nonlinear",
    "smallest_circle",
]
