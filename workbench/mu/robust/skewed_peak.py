"""The peak over frequency of the skewed mu: some blocks are at most 1, the others are bounded.

At a level b, divide the inputs of the varying blocks by b. If mu of the result is below 1 at every
frequency, the skewed mu is below b at every frequency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import ctx

from workbench._core.arrays import Array, BoolArray, RealArray
from workbench.certify.agreement import need_agreement
from workbench.certify.balls import in_plane, response_of
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.proofs.peak_proof import PeakProof
from workbench.certify.singularity import said
from workbench.certify.skewed import proven_skew_of, without_effect
from workbench.certify.stable_system import StableSystem
from workbench.errors import InputError
from workbench.input_checks import need_tolerance
from workbench.mu.frequency.peak import covered
from workbench.mu.frequency.sweep import fitting
from workbench.mu.robust.skew import Skew, numbers_of, upper_values
from workbench.mu.robust.skewed_bounds import (
    LEVEL_ROUNDING,
    SkewedPeak,
    SkewedPeakChecker,
    divided,
)
from workbench.structure import Structure
from workbench.systems.frequency_grid import starting_grid

GRID_REFINEMENTS = 12
"""Number of refinements of the grid around its largest values. Each halves the intervals about
maxima: from a tenth of a decade to 6e-5. With half of them a peak is found to 0.4 % and more is
left to the intervals of the proof; double costs time.
"""
MAXIMUM_SHARE = 0.7
"""Local maxima above this share of the largest value are refined. The proof covers all others. With
half of the distance from 1 fewer maxima are refined, and one that grows may be missed; double costs
time.
"""
CLOSEST_SPACING = 1e-6
"""An interval is not halved if its relative width is smaller than this. A peak that narrow belongs
to poles with a damping of 1e-6. Half or double changes nothing for others.
"""
POINTS_PER_REFINEMENT = 24
"""Largest number of intervals halved in one refinement. That is a dozen maxima. Half or double
changes the time, and what is left to the proof.
"""
PROOF_LEVELS, STEPS = 12, 300
"""Largest number of levels for which a proof is tried, and of steps for each. The distance of a
level from the largest upper bound at one frequency doubles from one level to the next. From half of
the tolerance, 12 reach 2,000 times it. Half or double changes when a proof is given up, and the
time.
"""
NEGLIGIBLE_GAIN = 1e-9
"""Gains below this share of the gain that varying blocks see directly and through one other block
are not resolved. It is far above rounding, 1e-16, and far below any gain of use. Half or double
changes a bound that small only.
"""
PERTURBED_FREQUENCIES = 8
"""Frequencies at which a worst perturbation is searched for. With half of them the lower bound may
belong to a lower peak; double costs time.
"""


def skewed_peak(
    system: Any,
    structure: Structure,
    fixed: Sequence[str | int] | str | int,
    *,
    tolerance: float = 1e-3,
) -> SkewedPeak:
    """Certified bounds of the supremum of the skewed mu over all frequencies.

    Parameters
    ----------
    system
        The stable system that Delta closes, in continuous or sampled time.
    structure
        Blocks of Delta, not all of them real scalars.
    fixed
        Names or numbers of the blocks with a size of at most 1. The others, at least one, vary.
    tolerance
        Relative distance by which the bound may lie above the largest upper bound at any one
        frequency.

    Raises
    ------
    InputError, UnknownNameError
        As `peak` and `skew_bounds`.
    ContradictionError
        The lower bound is above the upper one.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.mu import skewed_peak
    >>> from workbench.structure import Complex, Structure
    >>> system = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.1], [0.1, 0.5]], np.zeros((2, 2)))
    >>> found = skewed_peak(system, Structure([Complex(1), Complex(1)]), fixed=[0])
    >>> bool(found.lower <= found.upper), round(found.upper, 2)
    (True, 0.52)
    """
    need_tolerance(tolerance)
    stable = fitting(system, structure, sampled=True)
    varies = np.array([k not in numbers_of(structure, fixed) for k in range(len(structure))])
    if not varies.any():
        raise InputError("all blocks are fixed; leave at least one to vary, or use `peak`")
    search = SkewSearch(stable, structure, varies)
    level, proof, message = search.proven(tolerance)
    upper = math.inf if proof is None else level * proof.beta * LEVEL_ROUNDING
    lower, omega, Delta = search.attained()
    need_agreement(lower, upper, "the peak of the skewed mu")
    omega = float(stable.angular(omega))
    found = SkewedPeak(lower, upper, omega, Delta, message, level=level, proof=proof)
    return found.with_checker(SkewedPeakChecker(system, structure, varies))


class SkewSearch:
    """The frequencies (F,) [rad/s] bounded so far and their upper bounds (F,).

    ``varies`` (blocks,) marks the varying blocks of the structure.
    """

    def __init__(self, system: StableSystem, structure: Structure, varies: BoolArray) -> None:
        self.system, self.structure, self.varies = system, structure, varies
        self.inputs = np.repeat(varies, [block.rows for block in structure])
        self.omega, self.upper = np.empty(0), np.empty(0)
        self.add(starting_grid(system.poles))
        for _ in range(GRID_REFINEMENTS):
            self.add(self._wanted())

    def skew(self, omega: RealArray) -> Skew:
        """The skewed problem at frequencies (F,) [rad/s]."""
        return Skew(self.system.response(omega), self.structure, self.varies)

    def add(self, omega: RealArray) -> None:
        """Bound the skewed mu at further frequencies (K,) [rad/s]."""
        omega = np.setdiff1d(omega, self.omega)
        if omega.size:
            order = np.argsort(together := np.concatenate([self.omega, omega]))
            upper = np.concatenate([self.upper, self.skew(omega).upper()])
            self.omega, self.upper = together[order], upper[order]

    def _wanted(self) -> RealArray:
        """Frequencies [rad/s] halfway between the highest local maxima and their neighbours."""
        if not 0 < self.upper.max() < math.inf:
            return np.empty(0)
        padded = np.concatenate([[-np.inf], self.upper, [-np.inf]])
        high = self.upper >= MAXIMUM_SHARE * self.upper.max()
        top = high & (self.upper >= padded[:-2]) & (self.upper >= padded[2:])
        inner = (self.omega[:-1] > 0) & (self.omega[1:] > self.omega[:-1] * (1 + CLOSEST_SPACING))
        split = np.flatnonzero((top[1:] | top[:-1]) & inner & np.isfinite(self.omega[1:]))
        height = np.maximum(self.upper[1:], self.upper[:-1])[split]
        split = split[np.argsort(-height)[:POINTS_PER_REFINEMENT]]
        return np.sqrt(self.omega[split] * self.omega[split + 1])

    def proven(self, tolerance: float) -> tuple[float, PeakProof | None, str]:
        """A level, the proof that mu is below 1 with inputs divided by it, and a message.

        The zero response has the level 0 and needs no multipliers.
        """
        size = self._size(self.system.response(self.omega))
        if size == 0.0:
            if without_effect(self.system, self.structure, self.varies):
                return 0.0, PeakProof(0.0, ()), "the response is zero"
            # the response is lost in the rounding of these poles
            size = self._size(self.system.summands(self.omega))
        least = NEGLIGIBLE_GAIN * size
        growth, level = tolerance / 2, least
        for _ in range(PROOF_LEVELS):
            place = float(self.omega[np.argmax(self.upper)])
            top = max(float(self.upper.max()), least)
            if math.isinf(top):
                message = (
                    "robust stability is not proven: mu of the perturbation is not below 1 at "
                    f"{place:.6g} rad/s"
                )
                return 0.0, None, message
            level = top * (1 + growth)
            scaled = divided(self.system, self.inputs, level)
            # The tolerance may use half of the distance between mu and 1 at this place.
            here = float(upper_values(scaled.response([place]), self.structure)[0])
            precision = min(max((1 - here) / 2, 1e-6), 1e-2)
            cover, message = covered(
                scaled, self.structure, precision, (0.0, math.inf), STEPS, most=1.0
            )
            if cover.proven < 1:
                intervals = tuple(sorted(cover.intervals, key=lambda one: one.low))
                return level, PeakProof(cover.proven, intervals), message
            self.add(cover.found.omega[[int(np.argmax(cover.found.upper))]])
            self.add(self._wanted())
            growth *= 2
        return 0.0, None, f"robust stability is not proven: no gain below {level:.6g} is"

    def _size(self, M: Array) -> float:
        """Size of a response (F, c, r) for the varying blocks, directly and through fixed blocks.

        The result does not depend on the units of the signals of fixed blocks.
        """
        places = self.structure.column_slices, self.structure.row_slices
        rows = [np.abs(M[:, out]).max(axis=1) for out in places[0]]
        sizes = np.array([[row[:, into].max(axis=1) for into in places[1]] for row in rows])
        sizes = np.moveaxis(sizes, -1, 0)  # (F, blocks, blocks)
        fixed = ~self.varies
        seen = sizes[:, :, self.varies].max(axis=2)
        size = seen[:, self.varies].max(axis=1)
        chain = seen[:, fixed]
        for _ in range(np.count_nonzero(fixed)):  # through one of them, through two, ...
            size = size + (sizes[:, self.varies][:, :, fixed] * chain[:, None]).max(axis=(1, 2))
            chain = (sizes[:, fixed][:, :, fixed] * chain[:, None]).max(axis=2)
        return float(size.max())

    def candidates(self) -> tuple[RealArray, Array, RealArray]:
        """Lower bounds (K,), perturbations and frequencies where the upper bounds are largest."""
        best = np.argsort(-self.upper)[:PERTURBED_FREQUENCIES]
        lower, Delta = self.skew(self.omega[best]).lower(self.upper[best])
        return lower, Delta, self.omega[best]

    def attained(self) -> tuple[float, float, Array]:
        """The largest lower bound proven for the system itself, its frequency and perturbation."""
        lower, Delta, omega = self.candidates()
        values = np.zeros(len(omega))
        for k in np.flatnonzero(lower > 0):
            with ctx.workprec(PRECISIONS[1]):
                v = in_plane(self.system.angular(omega[k]), self.system.period)
                M = response_of(self.system, v)
            if M is not None:
                proven = said(proven_skew_of(M, self.structure, self.varies, Delta[k]))
                values[k] = min(proven, lower[k])
        index = int(np.argmax(values))
        found = Delta[index] if values[index] > 0 else np.full_like(Delta[index], np.nan)
        return float(values[index]), float(omega[index]), found
