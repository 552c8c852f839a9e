"""Unstable members of small boxes of real parameters, found by moving poles to the right.

The rightmost pole is driven to the right by two kinds of steps: to those corners of the box to
which the slopes of poles point; and along single parameters, since a worst member may also lie on a
face or inside. Where the determinant is linear in each parameter, the worst member is most often a
corner (R. de Gaston and M. Safonov, "Exact calculation of the multiloop stability margin", IEEE TAC
33 (1988)).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench._core.arrays import RealArray
from workbench.mu.boxes.partition import MOST_CORNERS, BoxPart, corner_signs
from workbench.mu.boxes.recentred import RealParameters

POLES = 4
"""Number of rightmost poles of which each proposes a corner. Others near the rightmost one may be
the first to cross the axis. With half of them fewer unstable members are found; double costs time.
"""
GRID_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
"""Places at which each parameter is tried, as shares of the way from its lower to its upper end."""
STEP_SHARES = np.array([-0.1, -0.01, 0.01, 0.1])
"""Steps by which each parameter is moved, as shares of its range."""
MOST_MOVES = 40
"""Largest number of moves in one search. A search ends earlier once no move helps. With half of
them a search may end early, and the upper bound is looser; double costs time only.
"""


def corners_of_poles(given: RealParameters, box: BoxPart, values: RealArray) -> RealArray:
    """Corners (k, p) of a box toward which the poles at values (p,) move right, rightmost first."""
    right = given.pole_slopes(values) > 0
    return np.where(right, box.high, box.low)


def drawn_corners(box: BoxPart) -> RealArray:
    """All corners (k, p) of a box of few parameters; for many parameters, MOST_CORNERS random
    ones.
    """
    count = len(box.low)
    if 2**count <= MOST_CORNERS:
        signs = corner_signs(count)
    else:
        signs = np.random.default_rng(0).choice([-1.0, 1.0], (MOST_CORNERS, count))
    return np.where(signs > 0, box.high, box.low)


def unstable_member(
    given: RealParameters, box: BoxPart, start: RealArray, late: Callable[[], bool]
) -> RealArray | None:
    """Unstable values (p,) in a box, searched from ``start`` (p,); None if no move leads
    further.
    """
    values = np.clip(start, box.low, box.high)
    furthest = given.abscissae(values[None])[0]
    for _ in range(MOST_MOVES):
        if furthest > 0:
            return values
        if late():
            return None
        tried = np.vstack(
            [corners_of_poles(given, box, values)[:POLES], _single_changes(box, values)]
        )
        found = given.abscissae(tried)
        best = int(np.argmax(found))
        if not found[best] > furthest:
            return None
        values, furthest = tried[best], found[best]
    return None


def _single_changes(box: BoxPart, values: RealArray) -> RealArray:
    """Values (k, p) that differ from the given ones (p,) in one parameter."""
    places = np.hstack(
        [
            box.low[:, None] + (box.high - box.low)[:, None] * GRID_SHARES,
            values[:, None] + (box.high - box.low)[:, None] * STEP_SHARES,
        ]
    )
    places = np.clip(places, box.low[:, None], box.high[:, None])
    count, tried = places.shape
    moved = np.repeat(values[None], count * tried, axis=0)
    moved[np.arange(count * tried), np.repeat(np.arange(count), tried)] = places.ravel()
    return moved
