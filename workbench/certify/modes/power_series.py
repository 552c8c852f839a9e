"""Partial fractions as polynomials of frequency, on intervals that cover all frequencies.

On an interval about omega_0 of half-width h, with s = j omega_0 and t = (omega - omega_0) / h,

    1 / (j omega - l) = sum_m q (-j h q)^m t^m,   q = 1 / (s - l),

converges if the pole l is farther than h from s. A few terms are kept, and the rest is bounded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import EPS, BoolArray, ComplexArray, RealArray
from workbench.certify.modes.partial_fractions import PartialFractions
from workbench.certify.rounding import TINY, UPWARD

TERMS = 16
"""Number of terms of a power series. The rest falls as `LARGEST_RATIO` to this power. With half of
them intervals are narrower and about twice as many; with twice as many each takes twice as long.
The rest is bounded either way.
"""
LARGEST_RATIO = 0.7
"""Largest ratio of an interval's half-width to the distance of a pole from its middle. The rest
grows without bound towards 1. Half or double of the distance from 1 changes the width of intervals,
and the time.
"""
REST = 1e-6
"""Largest contribution of omitted terms, and of omitted modes, to a response, as a share of its
size. It is a hundredth of the tolerance of a norm, `NORM_TOLERANCE`. With half of it intervals are
a little narrower; double loosens bounds by 1e-6.
"""
NARROWEST = 1e-13
"""Least relative half-width of an interval; rounding of its ends may hide a narrower one. It is 450
roundings. Half or double decides the same but for poles that are nearly on the axis.
"""
MOST_INTERVALS = 5_000
"""The search stops at this number of intervals; other intervals, about single frequencies, then
prove the norm. It limits memory. Half or double changes which systems of very many resonances use
series.
"""
MODERATE = 1e100
"""Largest size of a response and of its poles; the least size is the reciprocal. Products of three
sizes are then doubles. Half or double changes nothing for a system in usual units.
"""
ENTRIES_AT_ONCE = 60_000
"""Number of intervals times poles whose powers are computed together. They take 1 MB for each
array. Half or double changes memory and time only.
"""


@dataclass(frozen=True, eq=False)
class Polynomials:
    """g(t) = sum_m terms[:, m] t^m on F intervals, |t| <= 1: ``terms`` (F, TERMS + 1, m, r).

    They approximate the response at the frequencies ``middle`` + ``half`` t (F,) [rad/s], the first
    one at ``half`` / t, with an error of at most ``error`` (F,) in the spectral norm. All intervals
    together cover the frequencies from 0 to infinity.
    """

    middle: RealArray
    half: RealArray
    terms: ComplexArray
    error: RealArray


def polynomials(fractions: PartialFractions) -> Polynomials | None:
    """The polynomials of the response on intervals; None if these are too many, or the size is
    extreme.
    """
    size = _size(fractions)
    if not 1 / MODERATE < size < MODERATE:
        return None
    kept, left_out = _kept(fractions, size)
    ends = _intervals(fractions, kept, size)
    if ends is None:
        return None
    low, high = ends
    terms = np.zeros((len(low), TERMS + 1, fractions.D.size), complex)
    terms[:, 0] = fractions.D.ravel()
    error = np.full(len(low), left_out)
    middle = np.append(0.0, (low[1:] + high[1:]) / 2)
    half = np.append(low[0], np.maximum(high[1:] - middle[1:], middle[1:] - low[1:]))
    half[1:] *= 1 + 4 * EPS
    # To infinity, 1 / (s - l) = sum_m l^m / s^(m + 1).
    poles, inverse = fractions.poles, np.full((1, 1), -1j / half[0])
    terms[:1, 1:] += _powers(fractions, kept, inverse, poles * inverse)
    error[:1] += _error(fractions, kept, half[:1, None], np.abs(poles) / half[0])
    step = max(ENTRIES_AT_ONCE // len(poles), 1)
    for start in range(1, len(low), step):
        part = slice(start, start + step)
        h, apart = half[part, None], 1j * middle[part, None] - poles
        factor, distance = 1 / apart, np.abs(apart)
        terms[part, :-1] += _powers(fractions, kept, factor, -1j * h * factor)
        error[part] += _error(fractions, kept, distance, h / distance)
    return Polynomials(middle, half, terms.reshape(-1, TERMS + 1, *fractions.D.shape), error)


def _size(fractions: PartialFractions) -> float:
    """The largest entry of the response at frequencies near the poles: an estimate, not a bound."""
    omega = np.unique(np.append(np.abs(fractions.poles), 0.0))
    with np.errstate(all="ignore"):
        found = (1.0 / (1j * omega[:, None] - fractions.poles)) @ _residues(fractions)
        entries = np.abs(found + fractions.D.ravel()).max(initial=0.0)
    return float(max(entries, np.abs(fractions.D).max(initial=0.0)))


def _residues(fractions: PartialFractions) -> ComplexArray:
    """c_i b_i (n, m r)."""
    products = fractions.out.T[:, :, None] * fractions.into[:, None, :]
    return products.reshape(len(fractions.poles), -1)


def _kept(fractions: PartialFractions, size: float) -> tuple[BoolArray, float]:
    """The poles (n,) that matter, and a bound of the contribution of all others at any
    frequency.
    """
    most = fractions.sizes / fractions.distance * UPWARD
    order = np.argsort(most)
    total = np.cumsum(most[order]) * UPWARD
    few = total <= REST * size
    kept = np.ones(len(most), bool)
    kept[order[few]] = False
    return kept, float(total[few].max(initial=0.0))


def _intervals(
    fractions: PartialFractions, kept: BoolArray, size: float
) -> tuple[RealArray, RealArray] | None:
    """Ends (F,) of intervals [rad/s] on which power series converge fast; the first is infinite.

    None if they would be too many.
    """
    poles, sizes = fractions.poles[kept], fractions.sizes[kept]
    natural = np.abs(poles) if len(poles) else np.ones(1)
    if not 1 / MODERATE < natural.min() <= natural.max() < MODERATE:
        return None
    edge = 2.0 ** math.ceil(math.log2(natural.max()) + 1.5)
    low = 2.0 ** math.floor(math.log2(natural.min()) - 2)
    steps = 2 * round(math.log2(edge / low))
    ends = np.append(0.0, low * 2.0 ** (np.arange(steps + 1) / 2))
    ends[-1] = edge
    found, count = [np.array([[edge, np.inf]])], 1
    wait = np.stack([ends[:-1], ends[1:]], axis=1)
    while len(wait):
        middle, half = wait.mean(axis=1), (wait[:, 1] - wait[:, 0]) / 2
        if count + len(wait) > MOST_INTERVALS or (half < NARROWEST * middle).any():
            return None
        ratio = half[:, None] / np.abs(1j * middle[:, None] - poles)
        with np.errstate(all="ignore"):
            rest = (ratio ** (TERMS + 1) / (1.0 - ratio)) @ sizes / half
        small = (ratio.max(axis=1, initial=0.0) <= LARGEST_RATIO) & (rest <= REST * size)
        found.append(wait[small])
        count += int(small.sum())
        (low, high), middle = wait[~small].T, middle[~small]
        wait = np.concatenate([np.stack([low, middle], axis=1), np.stack([middle, high], axis=1)])
    every = np.concatenate(found)
    return every[:, 0], every[:, 1]


def _powers(
    fractions: PartialFractions, kept: BoolArray, factor: ComplexArray, ratio: ComplexArray
) -> ComplexArray:
    """Terms (F, TERMS, m r) of the series sum_m factor ratio^m of each pole, (F, n) or (F, 1)."""
    residues, ratio = _residues(fractions)[kept], ratio[:, kept]
    product = np.broadcast_to(factor, (len(ratio), len(kept)))[:, kept].copy()
    found = np.empty((len(ratio), TERMS, residues.shape[1]), complex)
    for m in range(TERMS):
        found[:, m] = product @ residues
        product *= ratio
    return found


def _error(
    fractions: PartialFractions, kept: BoolArray, distance: RealArray, ratio: RealArray
) -> RealArray:
    """Error bounds (F,) of the series on intervals, with rounding and the error of the fractions.

    ``distance`` (F, n) or (F, 1) is 1 / |factor|, ``ratio`` (F, n) the size of that of `_powers`.
    """
    sizes = np.where(kept, fractions.sizes, 0.0)
    with np.errstate(all="ignore"):
        ratio = ratio * (1.0 + 16 * EPS)
        within = np.where(ratio < 1.0, 1.0 / (distance * (1.0 - ratio)) * UPWARD, np.inf)
        most = np.minimum(within, 1.0 / fractions.distance)
        rest = np.minimum(ratio, 1.0) ** TERMS
    rounding = 8 * (len(kept) + 6 * TERMS + 20) * EPS
    underflow = TERMS * TINY * (1.0 + sizes.sum()) * (1.0 + most.sum(axis=1))
    found: RealArray = ((rest + rounding) * most) @ sizes + fractions.error(most) + underflow
    return found * UPWARD
