"""Starting poles for the refinement: by linear regressions, and from fits of other orders."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.response.vector_fitting import spread_poles
from workbench.identification.rational_models.point import FitPoint
from workbench.identification.rational_models.steps import linear_step
from workbench.identification.rational_models.structure import ModelStructure

LINEAR_STEPS = 30
"""Most linear regressions from one set of poles."""
EXTRA_POLES = 4
"""Number of extra poles in one of the starts, which then keeps the most important ones."""
DELAY_PHASE = 1.0
"""Step of the delays that are tried, as a phase [rad] at the highest frequency."""
MOST_DELAYS = 200
"""Most delays that are tried."""
BEST_DELAYS = 3
"""Number of delays from which the refinement starts."""
DAMPING_OF_ADDED = 0.05
"""Damping ratio of a pair that is added to the poles of a lower order."""


def first_points(
    structure: ModelStructure, order: int, most: int, lower: Sequence[FitPoint] = ()
) -> list[FitPoint]:
    """Starting points of an order: the ``most`` cheapest ones, and extensions of lower orders.

    ``lower`` are fits of lower orders. Each is extended by poles where its error is largest, so
    that a higher order is never worse.
    """
    found = []
    for delay in _delays(structure, order):
        spread = _poles_over_the_band(structure, order)
        found += [by_regressions(structure, spread, delay, mirror) for mirror in (True, False)]
        if order:
            larger = _poles_over_the_band(structure, order + EXTRA_POLES)
            if structure.unknowns(order + EXTRA_POLES) < structure.data.count:
                wide = by_regressions(structure, larger, delay, True)
                kept = FitPoint(structure, _foremost(wide, order), delay)
                found += [kept, by_regressions(structure, kept.poles, delay, False)]
    cheapest = sorted(found, key=lambda point: point.cost)[:most]
    return cheapest + [more for point in lower for more in _extended(point, order)]


def by_regressions(
    structure: ModelStructure, poles: ComplexArray, delay: float, mirror: bool
) -> FitPoint:
    """The cheapest of the points that linear regressions reach from the given poles.

    mirror: whether unstable poles are mirrored after each step, since noise often makes them
    unstable.
    """
    point = best = FitPoint(structure, structure.allowed(poles), delay)
    for _ in range(LINEAR_STEPS if poles.size else 0):
        data = structure.data
        regressors = point.without_numerators(point.denominator_slopes(data.response))
        after = linear_step(point, regressors[:, : poles.size])
        if after is None:
            break
        if mirror:
            after = FitPoint(structure, structure.mirrored(after.poles), delay)
        gained = 1.0 - after.cost / point.cost if point.cost > 0 else 0.0
        point = after
        if point.cost < best.cost:
            best = point
        if abs(gained) < 1e-6:
            break
    return best


def _poles_over_the_band(structure: ModelStructure, order: int) -> ComplexArray:
    """Lightly damped pairs over the band; for sampled models on a linear scale of frequency."""
    omega = structure.data.omega
    if structure.sample_time is None:
        return np.asarray(spread_poles(omega / structure.unit, order))
    pairs = np.linspace(omega[0], omega[-1], order // 2 + 2)[1:-1] * structure.sample_time
    upper = 0.97 * np.exp(1j * pairs)
    middle = [0.8] if order % 2 else []
    return np.concatenate([upper, upper.conj(), middle])


def _delays(structure: ModelStructure, order: int) -> list[float]:
    """Starting delays [s]: the cheapest ones of a grid within the bounds."""
    if structure.delay_bounds is None:
        return [0.0]
    low, high = structure.delay_bounds
    step = DELAY_PHASE / float(structure.data.omega[-1])
    grid = np.linspace(low, high, int(np.clip(np.ceil((high - low) / step), 2, MOST_DELAYS)) + 1)
    spread = _poles_over_the_band(structure, order)
    costs = [by_regressions(structure, spread, float(each), True).cost for each in grid]
    return [float(grid[k]) for k in np.argsort(costs)[:BEST_DELAYS]]


def _foremost(point: FitPoint, order: int) -> ComplexArray:
    """The most important poles of a larger fit, by the size of their partial fractions."""
    structure, poles = point.structure, point.poles
    groups = [[int(k)] for k in np.flatnonzero(poles.imag == 0)]
    groups += [
        [int(k), int(np.argmin(np.abs(poles - poles[k].conj())))]
        for k in np.flatnonzero(poles.imag > 0)
    ]
    apart = poles[:, None] - poles
    np.fill_diagonal(apart, 1.0)
    slope = np.prod(apart, axis=1)
    sizes = []
    polynomials = point.basis.polynomials(poles)
    weight = structure.weight
    for group in groups:
        size = 0.0
        for _, share in point.each_share():
            with np.errstate(all="ignore"):
                residues = polynomials[group][:, : share.size] @ share / slope[group]
                part = sum(
                    r / (structure.x - poles[k]) for r, k in zip(residues, group, strict=True)
                )
                size = max(size, float(np.nan_to_num(np.abs(weight * part).max(), nan=np.inf)))
        sizes.append(size)
    kept: list[complex] = []
    for k in np.argsort(sizes)[::-1]:
        group = groups[k]
        if len(kept) + len(group) <= order:
            kept += [complex(poles[i]) for i in group]
        elif len(kept) < order:  # a pair needs two places and one is left: use a real pole
            kept.append(complex(_real_pole(structure, abs(poles[group[0]]))))
    return np.array(kept)


def _real_pole(structure: ModelStructure, size: float) -> float:
    """A stable real pole of roughly this size."""
    return -size if structure.sample_time is None else min(size, 0.9)


def _extended(point: FitPoint, order: int) -> list[FitPoint]:
    """Points that extend a fit of lower order by poles at its largest errors."""
    structure, added = point.structure, order - point.poles.size
    if added <= 0:
        return []
    places = _worst_places(structure, point, added)
    poles = point.poles
    while poles.size < order:
        if order - poles.size == 1:
            poles = np.append(poles, _place(structure, places[0], 1.0).real)
        else:
            pair = _place(structure, places[(poles.size - point.poles.size) // 2], DAMPING_OF_ADDED)
            poles = np.append(poles, [pair, pair.conjugate()])
    found = FitPoint(structure, structure.allowed(poles), point.delay)
    return [found, by_regressions(structure, poles, point.delay, structure.stable)]


def _worst_places(structure: ModelStructure, point: FitPoint, count: int) -> RealArray:
    """Frequencies [rad/s] (count,) of the largest smoothed errors, not too close together."""
    power = np.sum(np.abs(point.residual) ** 2, axis=(1, 2))
    width = max(len(power) // 20, 1)
    smooth = np.convolve(power, np.ones(width) / width, mode="same")
    places = []
    for _ in range(count):
        k = int(np.argmax(smooth))
        places.append(structure.data.omega[k])
        smooth[max(k - width, 0) : k + width + 1] = -1.0
        if smooth.max() < 0:
            smooth = np.abs(smooth)
    return np.array(places)


def _place(structure: ModelStructure, omega: float, damping: float) -> complex:
    """A stable pole near a frequency [rad/s], in units of the structure."""
    s = omega * complex(-damping, np.sqrt(max(1.0 - damping**2, 0.0)))
    if structure.sample_time is None:
        return s / structure.unit
    return complex(np.exp(s * structure.sample_time))
