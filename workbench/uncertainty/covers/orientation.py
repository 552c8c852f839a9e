"""Orientation of stadiums, which is a free choice of the designer (thesis, sections 5.4.2 and
5.4.3).

An orientation is a function of the frequencies omega (F,) [rad/s] and the deviations (F, N) from
the nominal; it returns the angles (F,) [rad] of the segments in the frame of the nominal. The
narrowest stadium has the least uncertainty. But its angle may jump along frequency, and no weight
can follow a jump. It also need not give the smallest mu for a given controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.geometry.points import canonical_angle
from workbench.uncertainty.covers.sets import stadiums_about_nominal

Orientation = Callable[[RealArray, ComplexArray], RealArray]
"""Function of omega (F,) [rad/s] and deviations (F, N) that gives angles (F,) [rad]."""
Cost = Callable[[RealArray, RealArray, RealArray, RealArray], RealArray]
"""Cost (F, A) of candidates: omega (F,), angle (A,), radius (F, A), half-length (F, A)."""

CANDIDATE_ANGLES = 360
"""Number of angles tried at every frequency, half a degree apart. A width changes by at most the
set's length times half of the step, 0.4 % of it. With half of them 0.9 %; with twice as many the
programming takes four times as long.
"""


def narrowest_angles(omega: RealArray, away: ComplexArray) -> RealArray:
    """Angles (F,) [rad] with the least width, as in the second set.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import narrowest_angles
    >>> away = np.array([[-1.0 - 1j, 0.0, 1.0 + 1j]])  # three plants on a line
    >>> float(narrowest_angles(np.array([1.0]), away)[0].round(4))
    0.7854
    """
    return stadiums_about_nominal(away).angle


def smooth_orientation(*, weight: float = 0.1) -> Orientation:
    """Orientation with small widths and small changes of angle along frequency.

    It minimises the sum of log(radius) + weight * (change of angle)^2 / (change of log omega) over
    all frequencies together.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import smooth_orientation
    >>> away = np.array([[-1.0 - 1j, 0.01, 1.0 + 1j]] * 3)
    >>> smooth_orientation(weight=0.1)(np.array([1.0, 2.0, 4.0]), away).shape
    (3,)
    """
    return cheapest_orientation(_narrow, weight)


def limited_orientation(
    *, limit: float = math.pi / 12, nominal: RealArray | float | None = None
) -> Orientation:
    """Orientation of the third set: the angle of least width, if it is near a nominal angle.

    At other frequencies the nominal angle is used.

    Parameters
    ----------
    limit
        Largest difference [rad] between the two angles for which the angle of least width is used.
    nominal
        Nominal orientation [rad], a number or an array (F,); None for the smooth one.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import limited_orientation
    >>> away = np.array([[-1.0 - 1j, 0.0, 1.0 + 1j]])
    >>> limited_orientation(nominal=0.0)(np.array([1.0]), away).round(4).tolist()  # pi/4 is far
    [0.0]
    """
    if not 0 < limit <= math.pi / 2:
        raise InputError(f"limit must lie in (0, pi/2] rad, it is {limit}")
    if nominal is not None and not np.isfinite(nominal).all():
        raise InputError(f"a nominal orientation must be finite, it is {nominal}")

    def orientation(omega: RealArray, away: ComplexArray) -> RealArray:
        given = (
            smooth_orientation()(omega, away)
            if nominal is None
            else np.asarray(nominal, dtype=float)
        )
        try:
            reference = np.broadcast_to(canonical_angle(given), omega.shape)
        except ValueError:
            raise InputError(
                f"a nominal orientation of shape {given.shape} does not fit "
                f"{omega.size} frequencies"
            ) from None
        angle = narrowest_angles(omega, away)
        return np.where(_turn(angle, reference) > limit, reference, angle)

    return orientation


def cheapest_orientation(cost: Cost, weight: float) -> Orientation:
    """Orientation that minimises the sum over frequency of a cost of angles and of their changes.

    It serves criteria other than width, such as a controller's mu. Dynamic programming along
    frequency finds the global optimum over `CANDIDATE_ANGLES` angles.

    Parameters
    ----------
    cost
        Cost of every candidate angle at every frequency, see `Cost`.
    weight
        Weight of (change of angle)^2 / (change of log omega); 0 treats every frequency separately.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import cheapest_orientation
    >>> def cost(omega, angle, radius, half_length):
    ...     return radius
    ...
    >>> away = np.array([[-1.0 - 1j, 0.0, 1.0 + 1j]])
    >>> cheapest_orientation(cost, weight=0.0)(np.array([1.0]), away).round(4).tolist()
    [0.7854]
    """
    if not weight >= 0:
        raise InputError(f"weight must not be negative, it is {weight}")

    def orientation(omega: RealArray, away: ComplexArray) -> RealArray:
        angle = np.arange(CANDIDATE_ANGLES) * math.pi / CANDIDATE_ANGLES
        every = np.broadcast_to(angle, (omega.size, CANDIDATE_ANGLES))
        shape = stadiums_about_nominal(away[:, None, :], every)
        costs = np.asarray(cost(omega, angle, shape.radius, shape.half_length), dtype=float)
        if costs.shape != every.shape or np.isnan(costs).any():
            raise InputError(f"the cost must be of shape {every.shape}, without NaN")
        weights = weight * angle[1] ** 2 / np.diff(np.log(omega))
        return angle[_cheapest_path(costs, weights)]

    return orientation


def _narrow(
    omega: RealArray, angle: RealArray, radius: RealArray, half_length: RealArray
) -> RealArray:
    """Cost log(radius), constant for radii below a thousandth of the stadium's radius plus
    half-length.
    """
    size = (radius + half_length).min(axis=1, keepdims=True)
    return np.log(np.maximum(radius, 1e-3 * size) + np.finfo(float).tiny)


@compiled
def _cheapest_path(costs: RealArray, weights: RealArray) -> NDArray[np.int_]:
    """Indices (F,) of least total cost, by Bellman's recursion back from the last frequency.

    Besides the ``costs`` (F, A), a change of the angle's index, the shorter way round the circle,
    costs its square times a weight (F - 1,).
    """
    count, angles = costs.shape
    follow = np.zeros((count, angles), dtype=np.int64)
    ahead = costs[count - 1].copy()
    for k in range(count - 2, -1, -1):
        _followers(ahead, weights[k], follow[k])
        least = np.empty(angles)
        for i in range(angles):
            change = abs(i - follow[k, i])
            change = min(change, angles - change)
            least[i] = weights[k] * change**2 + ahead[follow[k, i]]
        for i in range(angles):
            ahead[i] = costs[k, i] + least[i]
    path = np.empty(count, dtype=np.int64)
    path[0] = ahead.argmin()
    for k in range(count - 1):
        path[k + 1] = follow[k, path[k]]
    return path


@compiled
def _followers(ahead: RealArray, weight: float, found: NDArray[np.int_]) -> None:
    """For each index i the j of least ahead[j] + weight * change^2, by the lower envelope.

    The parabolas over i, one for each j and its copies round the circle, are inserted from left to
    right (Felzenszwalb and Huttenlocher, Theory of Computing 8, 2012).
    """
    angles, last = ahead.size, -1
    if weight == 0.0:
        found[:] = ahead.argmin()
        return
    places = np.empty(2 * angles + 1, dtype=np.int64)
    starts = np.empty(2 * angles + 1)
    for place in range(-(angles // 2) - 1, angles + (angles + 1) // 2):
        value = ahead[place % angles]
        if value == np.inf:
            continue
        start = -np.inf
        while last >= 0:
            other = places[last]
            fall = (ahead[other % angles] - value) / (2 * weight * (place - other))
            start = 0.5 * (place + other) - fall
            if start > starts[last]:
                break
            last -= 1
            start = -np.inf
        last += 1
        places[last], starts[last] = place, start
    on = 0
    for i in range(angles if last >= 0 else 0):
        while on < last and starts[on + 1] < i:
            on += 1
        found[i] = places[on] % angles


def _turn(one: RealArray, other: RealArray) -> RealArray:
    """Difference [rad] of two directions modulo pi, at most pi/2."""
    distance: RealArray = np.abs(np.mod(one - other + math.pi / 2, math.pi) - math.pi / 2)
    return distance
