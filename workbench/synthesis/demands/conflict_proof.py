"""A proof that no controller satisfies several weights on a plant, each one separately.

At a frequency the weights of S say |1 - T| <= 1 / w_S, and those of T and K S = T / G say |T| <= 1
/ w_T: T lies in a lens. For any share x from 0 to 1, T also lies in the disk

    x w_S^2 |1 - T|^2 + (1 - x) w_T^2 |T|^2 <= 1,

which is smallest if its centre is on the chord of the lens. `DualCertificate` proves, by an
integral over all frequencies, that no controller keeps T in these disks. So no controller meets the
demands either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.demands import DemandWeight, rational_of
from workbench.synthesis.limits.analytic_basis import AnalyticBasis
from workbench.synthesis.limits.dual_bound import DualCertificate
from workbench.synthesis.limits.dual_search import dual_candidate
from workbench.synthesis.limits.intervals import Interval, down
from workbench.synthesis.limits.loop_functions import LeastWeights, LoopFunctions
from workbench.synthesis.limits.rational_bounds import (
    FrequencyCells,
    asymptote,
    largest_magnitude,
    least_magnitude,
)

CORNERS = 24
"""Number of basis functions of a proof, besides those of zeros and poles right of the axis."""
BELOW, ABOVE = 0.1, 10.0
"""The lowest corner relative to the slowest root, and the highest corner relative to the frequency
above which |T| must decrease.
"""
BAND = (1e-6, 1e2)
"""Lowest frequency of the search relative to the lowest corner, and highest frequency relative to
the highest corner. Lower frequencies are no part of the search: T is about 1 there, and h may be
large.
"""
FAR = 2.0
"""Largest level tried, relative to the level that the norms prove."""
LEVELS = 8
"""Number of levels that are tried."""
POINTS = 20_000
"""Number of frequencies in a sum that approximates the integral."""
CORNER_ROUNDING = 1e-9
"""Relative rounding of the corners of a lens."""
LEAST_SIZE = 1e-100
"""Smaller weights are replaced by this, so that the squares of their inverses are finite."""
SHARE_ROUNDING = 1e-12
"""Relative reduction of the roots of the shares, so that rounded shares add up to at most 1."""
LEAST_SHARE = 1e-9
"""Least share of the weights of S, and of those of T."""


@dataclass(frozen=True, eq=False)
class DemandedLoop(LoopFunctions):
    """A loop with several weights; each one separately limits the set of T.

    Unlike a closed `StateSpace`, it has no controller: weights limit the set of all T.

    ``more`` holds all weights. ``performance`` and ``control`` of the base class are the constant 1
    and a weight of K S.
    """

    more: tuple[DemandWeight, ...] = field(default=())
    level: float = 1.0
    """The level for which the disks are smallest. For other levels they contain the lenses too."""

    @np.errstate(all="ignore")
    def over(self, cells: FrequencyCells) -> LeastWeights:
        """Weights of the disks that contain the lenses over cells, rounded downward."""
        of_S, of_T = np.zeros(cells.low.shape), np.zeros(cells.low.shape)
        plant = largest_magnitude(self.plant, cells)
        for one in self.more:
            size = np.fmax(least_magnitude(one.W, cells), 0.0)
            if one.channel == "S":
                of_S = np.fmax(of_S, size)
            elif one.channel == "T":
                of_T = np.fmax(of_T, size)
            else:
                of_T = np.fmax(of_T, down(size / plant))
        share = _chord_share(of_S / self.level, of_T / self.level)
        base = super().over(cells)  # for its weights of the uncertainty, which are 0
        of_S = down(np.sqrt(share) * (1 - SHARE_ROUNDING) * of_S)
        of_T = down(np.sqrt(1 - share) * (1 - SHARE_ROUNDING) * of_T)
        return replace(base, performance=of_S, control=of_T)

    @np.errstate(all="ignore")
    def largest_beyond(self, lowest: float, level: float) -> float:
        """A number c with |T| <= c / omega^`falls` above `lowest` [rad/s], from the weights
        of K S.
        """
        above = asymptote(self.plant, lowest)
        found = [
            float((above * Interval.of(level) / asymptote(one.W, lowest)).high)
            for one in self.more
            if one.channel == "KS"
        ]
        return float(np.nanmin(found))


def _chord_share(of_S: RealArray, of_T: RealArray) -> RealArray:
    """The share x of the smallest disk around each lens: its centre is the middle of the chord."""
    squares = of_S**2, of_T**2
    chord = np.clip((1 + 1 / squares[1] - 1 / squares[0]) / 2, 0.0, 1.0)
    part, rest = chord * squares[1], (1 - chord) * squares[0]
    share = np.nan_to_num(part / (part + rest), nan=0.5)
    found: RealArray = np.clip(share, LEAST_SHARE, 1 - LEAST_SHARE)
    return found


def demanded_loop(plant: Rational, weights: Sequence[DemandWeight], level: float) -> DemandedLoop:
    """The weighted loop of a plant, including delays, for `conflict_proof`.

    At least one of the weights must be a weight of K S.
    """
    control = next(one.W for one in weights if one.channel == "KS")
    return DemandedLoop(rational_of([], [], 1.0), control, plant, more=tuple(weights), level=level)


def conflict_proof(
    plant: Rational, weights: Sequence[DemandWeight], bound: float, context: Context
) -> DualCertificate | None:
    """A proof that no stabilising controller satisfies all weights; None where none is found.

    The level of the proof is above 1: no controller satisfies all weights divided by this level.
    Bisection between 1 and `FAR` times ``bound`` judges levels by sums over frequencies. The levels
    found are then proven.
    """
    basis = proof_basis(plant, weights)
    low, high = 1.0, FAR * bound
    found: list[DualCertificate] = []
    for _ in context.rounds(LEVELS, "levels of the proof"):
        level = float(np.sqrt(low * high))
        loop = demanded_loop(plant, weights, level)
        try:
            tried = dual_candidate(loop, basis, level, context)
        except SolverError:
            break
        if summed_excess(tried, loop) < 0:
            found.append(tried)
            low = level
        else:
            high = level
    tried_again = [found[k] for k in (-1, len(found) // 2, 0)] if found else []
    return next(
        (one for one in tried_again if one.excess(demanded_loop(plant, weights, one.level)) < 0),
        None,
    )


def summed_excess(proof: DualCertificate, loop: DemandedLoop) -> float:
    """Approximation of `DualCertificate.excess` by a sum over frequencies, for the lenses
    themselves.
    """
    omega = 2 * np.pi * np.geomspace(*proof.basis.band_hz, POINTS)
    h = proof.h(omega)
    of_S, of_T = np.full(omega.size, LEAST_SIZE), np.full(omega.size, LEAST_SIZE)
    for one in loop.more:
        size = np.abs(one.W.response(omega)) / proof.level
        if one.channel == "S":
            of_S = np.maximum(of_S, size)
        else:
            over = np.abs(loop.plant.response(omega)) if one.channel == "KS" else 1.0
            of_T = np.maximum(of_T, size / over)
    most = _largest_in_lenses(of_S, of_T, h)
    whole = np.trapezoid(most, omega) + most[0] * omega[0]
    return float(whole - np.pi * proof.basis.known @ proof.coefficients)


def _largest_in_lenses(of_S: RealArray, of_T: RealArray, h: ComplexArray) -> RealArray:
    """Largest Re(T h) (F,) with |1 - T| <= 1 / of_S and |T| <= 1 / of_T; -inf if there is no such
    T.

    It is reached at the farthest point of one disk, if this lies in the other disk, or else at a
    corner of the lens.
    """
    small, large = 1 / of_S, 1 / of_T
    turn = np.conj(h) / np.maximum(np.abs(h), 1e-300)
    chord = (1 + large**2 - small**2) / 2
    corner = chord + 1j * np.sqrt(np.maximum(large**2 - chord**2, 0))
    most = np.full(h.shape, -np.inf)
    slack = 1 + CORNER_ROUNDING
    for T in (1 + small * turn, large * turn, corner, np.conj(corner)):
        inside = (np.abs(1 - T) <= small * slack) & (np.abs(T) <= large * slack)
        most = np.where(inside, np.maximum(most, (T * h).real), most)
    return most


def proof_basis(plant: Rational, weights: Sequence[DemandWeight]) -> AnalyticBasis:
    """Basis functions for the frequencies from the slowest root to where |T| must decrease."""
    roots = np.abs(np.concatenate([plant.zeros, plant.poles, *(one.W.zeros for one in weights)]))
    roots = roots[roots > 0]
    low = BELOW * float(roots.min())
    omega = np.geomspace(low, 1e8 * float(roots.max()), 2000)
    size = np.max(
        [np.abs(one.W.response(omega)) for one in weights if one.channel == "KS"], axis=0
    ) / np.abs(plant.response(omega))
    falls = omega[min(int(np.argmax(size > 1)) if (size > 1).any() else -1, omega.size - 1)]
    high = ABOVE * max(float(falls), float(roots.max()))
    corners = np.geomspace(low, high, CORNERS)
    right = [
        np.unique(each[(each.real > 0) & (each.imag >= 0)]) for each in (plant.zeros, plant.poles)
    ]
    band = (low * BAND[0] / (2 * np.pi), high * BAND[1] / (2 * np.pi))
    return AnalyticBasis(corners, band, zeros=right[0], poles=right[1])
