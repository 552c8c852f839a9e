"""A proof that no controller keeps several weights on a plant, each by itself.

At a frequency the weights of S say |1 - T| <= 1 / w_S, and those of T and K S = T / G say
|T| <= 1 / w_T: T lies in a lens. For any share x from 0 to 1 it lies in the disk

    x w_S^2 |1 - T|^2 + (1 - x) w_T^2 |T|^2 <= 1,

which is least where its centre is on the chord of the lens. So what `DualCertificate` proves of
such disks with one weight each, by an integral over all frequencies, it proves of the demands.
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
"""Functions of which a proof consists, beside those of zeros and poles right of the axis."""
BELOW, ABOVE = 0.1, 10.0
"""Corners begin at this multiple of the slowest weight and end at this one of where T must fall."""
BAND = (1e-6, 1e2)
"""First and last frequency over the first and last corner. What lies below the first one is no part
of the search: T is 1 there, and h may be large."""
FAR = 2.0
"""Factor up to which a level above that of the norm is tried."""
LEVELS = 8
"""Levels that are tried."""
POINTS = 20_000
"""Points of a sum."""
CORNER_ROUNDING = 1e-9
"""Relative rounding of the corners of a lens."""
LEAST_SIZE = 1e-100
"""Weights below it are this, so that squares of their inverses are finite."""
SHARE_ROUNDING = 1e-12
"""What roots of shares are made smaller by, so that the shares are at most 1 together."""
LEAST_SHARE = 1e-9
"""Least share of either kind of weights."""


@dataclass(frozen=True, eq=False)
class DemandedLoop(LoopFunctions):
    """The sets of T that several weights leave, each of them by itself.

    ``performance`` and ``control`` of the base are one weight of S and one of K S; the others are
    ``more``.
    """

    more: tuple[DemandWeight, ...] = field(default=())
    level: float = 1.0
    """The level at which the disks are least; at others they hold the lenses too."""

    @np.errstate(all="ignore")
    def over(self, cells: FrequencyCells) -> LeastWeights:
        """Weights of disks around the lenses over cells, rounded downward."""
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
        base = super().over(cells)  # for its parts that are 0: no uncertainty
        of_S = down(np.sqrt(share) * (1 - SHARE_ROUNDING) * of_S)
        of_T = down(np.sqrt(1 - share) * (1 - SHARE_ROUNDING) * of_T)
        return replace(base, performance=of_S, control=of_T)

    @np.errstate(all="ignore")
    def largest_beyond(self, lowest: float, level: float) -> float:
        """A number c: |T| <= c / omega^`falls` above `lowest` [rad/s], by a weight of K S."""
        above = asymptote(self.plant, lowest)
        found = [
            float((above * Interval.of(level) / asymptote(one.W, lowest)).high)
            for one in self.more
            if one.channel == "KS"
        ]
        return float(np.nanmin(found))


def _chord_share(of_S: RealArray, of_T: RealArray) -> RealArray:
    """The share x of the least disk around each lens: its centre is where the chord is."""
    squares = of_S**2, of_T**2
    chord = np.clip((1 + 1 / squares[1] - 1 / squares[0]) / 2, 0.0, 1.0)
    part, rest = chord * squares[1], (1 - chord) * squares[0]
    share = np.nan_to_num(part / (part + rest), nan=0.5)
    found: RealArray = np.clip(share, LEAST_SHARE, 1 - LEAST_SHARE)
    return found


def demanded_loop(plant: Rational, weights: Sequence[DemandWeight], level: float) -> DemandedLoop:
    """The loop of a plant, with its delays, of which `conflict_proof` speaks.

    One of the weights is of K S.
    """
    control = next(one.W for one in weights if one.channel == "KS")
    return DemandedLoop(rational_of([], [], 1.0), control, plant, more=tuple(weights), level=level)


def conflict_proof(
    plant: Rational, weights: Sequence[DemandWeight], bound: float, context: Context
) -> DualCertificate | None:
    """A proof that no stabilising controller keeps each of the weights; None where none is found.

    Its level is above 1: no controller keeps each weight over that level. ``bound`` is where it is
    looked for. Levels are bisected by sums over points; what they show is then proven.
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
    """What `DualCertificate.excess` bounds, by a sum over points of the lenses themselves."""
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
    most = _in_lenses(of_S, of_T, h)
    whole = np.trapezoid(most, omega) + most[0] * omega[0]
    return float(whole - np.pi * proof.basis.known @ proof.coefficients)


def _in_lenses(of_S: RealArray, of_T: RealArray, h: ComplexArray) -> RealArray:
    """The largest Re(T h) (F,) with |1 - T| <= 1 / of_S and |T| <= 1 / of_T; -inf: none.

    It is the farthest point of one disk where that lies in the other one, else a corner.
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
    """Functions from the slowest weight to where T must fall; zeros and poles of the plant."""
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
