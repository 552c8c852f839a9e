"""Smallest circles and narrowest stadiums around sets of complex points."""

from workbench.geometry import conic, nonlinear
from workbench.geometry.circle import Circle, SmallestCircle, smallest_circle
from workbench.geometry.stadium import NarrowestStadium, Stadium, narrowest_stadium
from workbench.geometry.stadium_arithmetic import (
    around_nominal,
    multiplied,
    signed_distance,
    signed_distance_bounds,
)

__all__ = [
    "Circle",
    "NarrowestStadium",
    "SmallestCircle",
    "Stadium",
    "around_nominal",
    "conic",
    "multiplied",
    "narrowest_stadium",
    "nonlinear",
    "signed_distance",
    "signed_distance_bounds",
    "smallest_circle",
]
