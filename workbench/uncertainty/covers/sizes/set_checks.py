"""Distance of the sets of a cover from the smallest sets, computed from the points only."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import Check, worst_value
from workbench.geometry import Circle, NarrowestStadium, SmallestCircle, Stadium
from workbench.geometry.bounds import circle_radius_bound


class Named(Protocol):
    """Base of objects that name the place of the f-th set."""

    def place(self, f: int, /) -> str: ...


def set_off(
    sets: NarrowestStadium | SmallestCircle,
    found: Circle | Stadium,
    least: RealArray,
    rounding: RealArray,
) -> RealArray:
    """Distance (F,) of the sets from the smallest ones, relative to the least radius ``least``.

    The distance is due to points outside a set, radii that differ from the least ones, a centre
    that differs from the given one, or round ends that touch no point. ``rounding`` (F,) is the
    possible rounding error of a radius.
    """
    beyond = sets.distance(found).max(axis=-1) - found.radius
    off = np.maximum(beyond, np.abs(found.radius - least))
    if isinstance(sets, NarrowestStadium) and isinstance(found, Stadium):
        off = np.maximum(off, sets.slack(found) * np.abs(found.radius))
        if sets.center is not None:
            off = np.maximum(off, np.abs(found.center - sets.center))
    off = off - rounding
    return np.where(off <= 0, 0.0, off / np.maximum(least, np.finfo(float).tiny)).astype(float)


def least_radii(sets: NarrowestStadium | SmallestCircle, found: Circle | Stadium) -> RealArray:
    """Lower bound (F,) on the radii of sets around the points."""
    if isinstance(sets, NarrowestStadium) and isinstance(found, Stadium):
        return sets.radius_bound(found).astype(float)
    return circle_radius_bound(sets.points, found.center).astype(float)


def set_check(
    name: str, about: str, off: RealArray, limit: float, places: Named, over: str
) -> Check:
    """The check of one kind of set; ``about`` says what its centre is."""
    value, where = worst_value(off, lambda i: f"at {places.place(i[0])}")
    statement = f"largest difference of a set from the smallest one{about}, over its radius"
    return Check(name, statement, value, limit, where=where, over=over)
