"""The frequencies at which a perturbation of size 1 is not excluded yet."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.band_cover import BoundsAt, FrequencyBounds, parts_left_open
from workbench.certify.interval import proven_in_doubles
from workbench.certify.stable_system import StableSystem
from workbench.mu.frequency.complex_part import complex_part_added
from workbench.mu.frequency.sweep import bounds_at
from workbench.structure import Real, Structure
from workbench.systems.frequency_grid import starting_grid

Band = tuple[float, float]
"""Lowest and highest frequency [rad/s]; for a sampled system in the plane of the bilinear
transformation.
"""

WHOLE: tuple[Band, ...] = ((0.0, math.inf),)
"""All frequencies."""
PROMISING_BOUND = 0.98
"""Bounds below this are worth a proof on an interval. The proof on an interval raises a bound by a
little, so one nearer to 1 has no room. Half or double of the distance from 1 changes the time only.
"""
COMPLEX_SHARES = (0.1, 1e-3, 1e-6)
"""Complex parts of the parameters for which multipliers are chosen, tried in turn until one closes
a band. Multipliers for purely real parameters hold on far narrower intervals; near poles close to
the axis only a small complex part is possible. Half or double of all changes how wide proven
intervals are, and the time.
"""
MANY_PARAMETERS = 5
"""With this many real parameters or more, a part's bands are refined only if its bound of mu is
below 1 at the middles of all open bands; otherwise the part is cut at once. Halving each of p
parameters takes 2^p parts, while halving the intervals of frequency takes about twice the time.
Half or double changes which of the two is tried first, and so how many parts suffice.
"""
ROUNDS, MANY_ROUNDS = 3, 12
"""Largest number of rounds in which bounds are computed at the middles of the open bands: for few
and for many parameters. With many parameters a cut costs far more than a round. Half or double
changes whether a part is cut or refined, and the time.
"""
MOST_GAPS, MANY_GAPS = 12, 200
"""Largest number of open bands that are refined further (few and many parameters); with more, the
part is cut instead. So many bands say that the part is too large. Half or double changes whether a
part is cut or refined, and the time.
"""

AT_ONCE = 32
"""Number of frequencies bounded between two looks at the time limit. Half or double changes how
promptly a time limit is kept.
"""


def never() -> bool:
    """Whether time is up: never."""
    return False


def open_bands(
    system: StableSystem,
    structure: Structure,
    bands: tuple[Band, ...],
    late: Callable[[], bool] = never,
) -> tuple[tuple[Band, ...], ComplexArray]:
    """The bands that multipliers leave open, and the response with the largest upper bound.

    At all other frequencies I - M Delta is proven to be regular for every Delta of size up to 1.
    Multipliers without G are tried first, since they hold on wide intervals. The search ends once
    ``late()`` is true.
    """
    plain = partial(bounds_at, system, structure.complexified())
    points = _points(starting_grid(system.poles), bands)
    first = plain(points[:AT_ONCE])
    for k in range(AT_ONCE, len(points), AT_ONCE):
        if late():
            break
        first = first.joined(plain(points[k : k + AT_ONCE]))
    worst = first.M[int(np.argmax(first.upper))]
    bands = _left_open(system, first, bands, late)
    many = sum(isinstance(block, Real) for block in structure) >= MANY_PARAMETERS
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
                    bands = _left_open(system, at(_middles(bands)), bands, late)
            if bands == last:
                break
        if bands != before and not many:
            break
    return bands, worst


def _middles(bands: tuple[Band, ...]) -> RealArray:
    return np.unique([_middle(*band) for band in bands])


def _left_open(
    system: StableSystem,
    found: FrequencyBounds,
    bands: tuple[Band, ...],
    late: Callable[[], bool],
) -> tuple[Band, ...]:
    """The bands that known multipliers leave open; the largest bounds below 1 are used first."""
    for k in np.argsort(-found.upper):
        if late():
            break
        omega = float(found.omega[k])
        if found.upper[k] >= PROMISING_BOUND or not any(
            low <= omega <= high for low, high in bands
        ):
            continue
        multipliers = found.D_left[k], found.D_right[k], found.G[k]
        ends, _ = proven_in_doubles(system, multipliers, 1.0, omega)
        if ends is not None:
            bands = tuple(rest for gap in bands for rest in parts_left_open(gap, ends))
    return bands


def _with_real_blocks(system: StableSystem, structure: Structure, share: float) -> BoundsAt:
    """Function of frequencies: bounds by multipliers that allow a complex part of each parameter
    too.
    """
    larger, blocks = complex_part_added(system, structure, share)
    c, r = structure.columns, structure.rows

    def at(omega: RealArray) -> FrequencyBounds:
        found = bounds_at(larger, blocks, omega)
        left, right, G = found.D_left[:, :c, :c], found.D_right[:, :r, :r], found.G[:, :r, :c]
        return FrequencyBounds(omega, found.M[:, :c, :r], found.upper, left, right, G)

    return at


def _points(grid: RealArray, bands: tuple[Band, ...]) -> RealArray:
    """Frequencies of the grid inside the bands, and the ends and middles of the bands."""
    inside = [grid[(grid >= low) & (grid <= high)] for low, high in bands]
    middles = [_middle(*band) for band in bands]
    return np.unique(np.concatenate([*inside, np.ravel(bands), middles]))


def _middle(low: float, high: float) -> float:
    """A frequency between two others: their geometric mean where both are positive and finite."""
    if math.isinf(high):
        return 2.0 * low if low > 0 else 1.0
    return math.sqrt(low) * math.sqrt(high) if low > 0 else high / 2
