"""Smallest circles, narrowest stadiums and those of smallest area around complex points.

Takes: complex points of shape (..., N), a set in each row.
Gives: the sets, each certified to contain its points and to be the smallest.
Rests on: weak duality for circles; convex hulls and rotating calipers for stadiums.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import on_demand

if TYPE_CHECKING:
    from workbench.geometry.area import SmallestAreaStadium, smallest_area_stadium
    from workbench.geometry.circle import Circle, SmallestCircle, smallest_circle
    from workbench.geometry.enclosing_stadium import EnclosingStadium, Stadium
    from workbench.geometry.figures import outline
    from workbench.geometry.stadium import NarrowestStadium, narrowest_stadium
    from workbench.geometry.stadium_arithmetic import (
        multiplied_sets,
        sets_around_nominal,
        signed_distance,
        signed_distance_bounds,
    )
else:
    __getattr__, __dir__ = on_demand(__name__)

__all__ = [
    "Circle",
    "EnclosingStadium",
    "NarrowestStadium",
    "SmallestAreaStadium",
    "SmallestCircle",
    "Stadium",
    "multiplied_sets",
    "narrowest_stadium",
    "outline",
    "sets_around_nominal",
    "signed_distance",
    "signed_distance_bounds",
    "smallest_area_stadium",
    "smallest_circle",
]
