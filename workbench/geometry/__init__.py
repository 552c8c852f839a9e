"""Smallest circles, narrowest stadiums and those of smallest area around complex points."""

from workbench.geometry import conic, nonlinear
from workbench.geometry.area import SmallestAreaStadium, smallest_area_stadium
from workbench.geometry.circle import Circle, SmallestCircle, smallest_circle
from workbench.geometry.enclosing import EnclosingStadium, Stadium
from workbench.geometry.stadium import NarrowestStadium, narrowest_stadium
from workbench.geometry.stadium_arithmetic import (
    around_nominal,
    multiplied,
    signed_distance,
    signed_distance_bounds,
)

__all__ = [
    "Circle",
    "EnclosingStadium",
    "NarrowestStadium",
    "SmallestAreaStadium",
    "SmallestCircle",
    "Stadium",
    "around_nominal",
    "conic",
    "multiplied",
    "narrowest_stadium",
    "nonlinear",
    "signed_distance",
    "signed_distance_bounds",
    "smallest_area_stadium",
    "smallest_circle",
]
