"""The frequencies at which a perturbation of size 1 is not excluded yet."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.cover import BoundsAt, FrequencyBounds, without
from workbench.certify.interval import proven_in_doubles
from workbench.certify.stable_system import StableSystem
from workbench.mu.frequency.complex_part import with_complex_part
from workbench.mu.frequency.sweep import bounds_at
from workbench.structure import Real, Structure
from workbench.systems.frequency_grid import starting_grid

Band = tuple[float, float]
"""Lowest and highest frequency [rad/s], those of the bilinear plane for a sampled system."""

WHOLE: tuple[Band, ...] = ((0.0, math.inf),)
"""All frequencies."""
PROMISING = 0.98
"""Bounds below this are worth a proof on an interval."""
COMPLEX_SHARES = (0.1, 1e-3, 1e-6)
"""Complex parts of the parameters for which multipliers are chosen, the first that serves. Those of
real parameters alone hold on far narrower intervals; poles near the axis leave room for little."""
MANY = 5
"""Real parameters from which on a part is cut only where its bound at a frequency asks for it: to
halve each of p takes 2^p parts, to halve the intervals of frequency about twice the time."""
ROUNDS, MANY_ROUNDS = 3, 12
"""Rounds in which the middles of what is open are bounded too, of few parameters and of many."""
MOST_GAPS, MANY_GAPS = 12, 200
"""Gaps from which a part is cut rather than covered further."""

AT_ONCE = 32
"""Frequencies that are bounded before a time limit is looked at."""


def never() -> bool:
    """No time limit."""
    return False


def open_bands(
    system: StableSystem,
    structure: Structure,
    bands: tuple[Band, ...],
    late: Callable[[], bool] = never,
) -> tuple[tuple[Band, ...], ComplexArray]:
    """What multipliers leave open of the bands, and the response where the bound is largest.

    At all other frequencies I - M Delta is proven to be regular for every Delta of size up to 1.
    First multipliers without G are tried, since they hold on wide intervals. No more is tried once
    it is ``late``.
    """
    plain = partial(bounds_at, system, structure.complexified())
    points = _points(starting_grid(system.poles), bands)
    first = plain(points[:AT_ONCE])
    for k in range(AT_ONCE, len(points), AT_ONCE):
        if late():
            break
        first = first.joined(plain(points[k : k + AT_ONCE]))
    worst = first.M[int(np.argmax(first.upper))]
    bands = _covered(system, first, bands, late)
    many = sum(isinstance(block, Real) for block in structure) >= MANY
    rounds, gaps = (MANY_ROUNDS, MANY_GAPS) if many else (ROUNDS, MOST_GAPS)
    if many and bands and not late():
        sharp = _with_real_blocks(system, structure, COMPLEX_SHARES[-1])(_middles(bands))
        if sharp.upper.max() >= 1.0:
            return bands, sharp.M[int(np.argmax(sharp.upper))]
    for share in COMPLEX_SHARES:
        mixed, before = _with_real_blocks(system, structure, share), bands
        for _ in range(rounds):
            if not bands or len(bands) > gaps or late():
                return bands, worst
            last = bands
            for at in (plain, mixed):
                if bands and not late():
                    bands = _covered(system, at(_middles(bands)), bands, late)
            if bands == last:
                break
        if bands != before and not many:
            break
    return bands, worst


def _middles(bands: tuple[Band, ...]) -> RealArray:
    return np.unique([_middle(*band) for band in bands])


def _covered(
    system: StableSystem,
    found: FrequencyBounds,
    bands: tuple[Band, ...],
    late: Callable[[], bool],
) -> tuple[Band, ...]:
    """What known multipliers leave open, those of the largest bounds below 1 first."""
    for k in np.argsort(-found.upper):
        if late():
            break
        omega = float(found.omega[k])
        if found.upper[k] >= PROMISING or not any(low <= omega <= high for low, high in bands):
            continue
        multipliers = found.D_left[k], found.D_right[k], found.G[k]
        ends, _ = proven_in_doubles(system, multipliers, 1.0, omega)
        if ends is not None:
            bands = tuple(rest for gap in bands for rest in without(gap, ends))
    return bands


def _with_real_blocks(system: StableSystem, structure: Structure, share: float) -> BoundsAt:
    """Bounds whose multipliers hold for parameters with a complex part as well."""
    larger, blocks = with_complex_part(system, structure, share)
    c, r = structure.columns, structure.rows

    def at(omega: RealArray) -> FrequencyBounds:
        found = bounds_at(larger, blocks, omega)
        left, right, G = found.D_left[:, :c, :c], found.D_right[:, :r, :r], found.G[:, :r, :c]
        return FrequencyBounds(omega, found.M[:, :c, :r], found.upper, left, right, G)

    return at


def _points(grid: RealArray, bands: tuple[Band, ...]) -> RealArray:
    """Those of a grid in the bands, their ends and their middles."""
    inside = [grid[(grid >= low) & (grid <= high)] for low, high in bands]
    middles = [_middle(*band) for band in bands]
    return np.unique(np.concatenate([*inside, np.ravel(bands), middles]))


def _middle(low: float, high: float) -> float:
    """A frequency between two, in the middle of their logarithms where both are finite."""
    if math.isinf(high):
        return 2.0 * low if low > 0 else 1.0
    return math.sqrt(low) * math.sqrt(high) if low > 0 else high / 2
