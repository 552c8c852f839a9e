"""Orientation of stadiums: a freedom of the design (thesis, sections 5.4.2 and 5.4.3).

An orientation is a function of the frequencies omega (F,) [rad/s] and the deviations (F, N) from
the nominal; it returns the angles (F,) [rad] of the segments in the frame of the nominal. The
narrowest stadium is the least uncertain one, but its angle may jump along frequency, where no
weight can follow it, and it is not the best one for a given controller's mu.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.geometry.points import canonical_angle
from workbench.uncertainty.covers.sets import stadiums_about_nominal

Orientation = Callable[[RealArray, ComplexArray], RealArray]
Cost = Callable[[RealArray, RealArray, RealArray, RealArray], RealArray]
"""Cost (F, A) of candidates: omega (F,), angle (A,), radius (F, A), half-length (F, A)."""

CANDIDATES = 360
"""Angles tried at every frequency, half a degree apart."""


def narrowest(omega: RealArray, away: ComplexArray) -> RealArray:
    """The second set: the angle of least width at every frequency."""
    return stadiums_about_nominal(away).angle


def smooth(weight: float = 0.1) -> Orientation:
    """Small widths against small changes of angle, the best trade-off over the whole axis.

    Minimises the sum of log(radius) + weight * (change of angle)^2 / (change of log omega).
    """
    return cheapest(_narrow, weight)


def limited(limit: float = math.pi / 12, nominal: RealArray | float | None = None) -> Orientation:
    """The third set: where the narrowest angle strays from a nominal one, the nominal one.

    Parameters
    ----------
    limit
        Largest distance [rad] between them that is let pass.
    nominal
        Nominal orientation [rad], a number or of shape (F,); None: the smooth one.
    """
    if not 0 < limit <= math.pi / 2:
        raise InputError(f"limit must lie in (0, pi/2] rad, it is {limit}")
    if nominal is not None and not np.isfinite(nominal).all():
        raise InputError(f"a nominal orientation must be finite, it is {nominal}")

    def orientation(omega: RealArray, away: ComplexArray) -> RealArray:
        given = smooth()(omega, away) if nominal is None else np.asarray(nominal, dtype=float)
        try:
            reference = np.broadcast_to(canonical_angle(given), omega.shape)
        except ValueError:
            raise InputError(
                f"a nominal orientation of shape {given.shape} does not fit "
                f"{omega.size} frequencies"
            ) from None
        angle = narrowest(omega, away)
        return np.where(_turn(angle, reference) > limit, reference, angle)

    return orientation


def cheapest(cost: Cost, weight: float) -> Orientation:
    """Least sum over frequency of a cost of the candidates and of their change of angle.

    The hook for orientations chosen by other criteria than width, such as a controller's mu.
    Globally optimal over `CANDIDATES` angles by dynamic programming along frequency.

    Parameters
    ----------
    cost
        Cost of every candidate angle at every frequency, see `Cost`.
    weight
        Of (change of angle)^2 / (change of log omega); 0: every frequency for itself.
    """
    if not weight >= 0:
        raise InputError(f"weight must not be negative, it is {weight}")

    def orientation(omega: RealArray, away: ComplexArray) -> RealArray:
        angle = np.arange(CANDIDATES) * math.pi / CANDIDATES
        every = np.broadcast_to(angle, (omega.size, CANDIDATES))
        shape = stadiums_about_nominal(away[:, None, :], every)
        costs = np.asarray(cost(omega, angle, shape.radius, shape.half_length), dtype=float)
        if costs.shape != every.shape or np.isnan(costs).any():
            raise InputError(f"the cost must be of shape {every.shape}, without NaN")
        turn = _turn(angle[:, None], angle[None, :]) ** 2
        return angle[_cheapest_path(costs, turn, weight / np.diff(np.log(omega)))]

    return orientation


def _narrow(
    omega: RealArray, angle: RealArray, radius: RealArray, half_length: RealArray
) -> RealArray:
    """log(radius), level below a thousandth of the stadium's whole size."""
    size = (radius + half_length).min(axis=1, keepdims=True)
    return np.log(np.maximum(radius, 1e-3 * size) + np.finfo(float).tiny)


def _cheapest_path(costs: RealArray, turn: RealArray, weights: RealArray) -> np.ndarray:
    """Indices (F,) of least total cost, by Bellman's recursion from the last frequency back."""
    count, _ = costs.shape
    follow = np.zeros(costs.shape, dtype=int)
    ahead = costs[-1]
    for k in range(count - 2, -1, -1):
        total = weights[k] * turn + ahead[None, :]
        follow[k] = total.argmin(axis=1)
        ahead = costs[k] + total.min(axis=1)
    path = [int(ahead.argmin())]
    for k in range(count - 1):
        path.append(int(follow[k, path[-1]]))
    return np.array(path)


def _turn(one: RealArray, other: RealArray) -> RealArray:
    """Distance [rad] of directions modulo pi, at most pi/2."""
    distance: RealArray = np.abs(np.mod(one - other + math.pi / 2, math.pi) - math.pi / 2)
    return distance
