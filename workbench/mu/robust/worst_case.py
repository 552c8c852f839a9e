"""The worst-case gain: the largest gain of a channel over all frequencies and perturbations.

Divide the exogenous inputs of N by gamma and close the performance channel by a full block. By the
main loop theorem, sigma_max(F_u(N(jw), Delta)) is below gamma for all Delta of size at most 1 where
mu of this matrix is below 1. At one frequency the least such gamma is the skewed mu with the blocks
of the perturbation fixed.

Source: K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 11.7; A. Packard,
G. Balas, R. Liu, J.-Y. Shin, "Results on worst-case performance assessment", ACC 2000.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array, RealArray
from workbench.certify.agreement import need_agreement
from workbench.certify.perturbed_loop import proven_at, proven_gain, proven_over_frequency
from workbench.certify.proofs.peak_proof import PeakProof
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.errors import InputError
from workbench.input_checks import need_structure, need_tolerance
from workbench.mu.frequency.peak import peak
from workbench.mu.robust.skew import Skew, upper_values
from workbench.structure import Structure
from workbench.systems.frequency_grid import starting_grid
from workbench.systems.joints import UncertainPart

GRID_REFINEMENTS = 12
"""Number of refinements of the grid around its largest values."""
MAXIMUM_SHARE = 0.7
"""Local maxima above this share of the largest value are refined."""
CLOSEST_SPACING = 1e-6
"""Intervals between neighbours of a smaller relative width are not halved."""
POINTS_PER_REFINEMENT = 24
"""Most intervals halved in one refinement."""
PROOF_LEVELS = 20
"""Most levels for which a proof is tried."""
NEGLIGIBLE_GAIN = 1e-9
"""Gains below this share of the largest entry of the system's response are not resolved."""
LEVEL_ROUNDING = 1 + 1e-12
"""Factor on the product of level and mu that rounds it, and the division by the level, outward."""
PERTURBED_FREQUENCIES = 8
"""Frequencies at which a worst perturbation is searched for."""


@dataclass(frozen=True, eq=False)
class WorstCaseGain:
    """Bounds of the largest gain over all frequencies and perturbations.

    ``lower`` is proven to be at most the largest singular value of F_u(N(j omega), Delta) for the
    perturbation ``Delta`` (r, c), of size at most 1, at ``omega`` [rad/s]; it is infinite where a
    multiple of Delta, of size at most 1, is proven to make the loop singular. ``upper`` is infinite
    where no bound was proven; the message says why.
    ``proof`` proves that mu is below 1 once the exogenous inputs are divided by ``level``; it is
    None, and the level 0, for an infinite bound. `worst_case_checks` proves it again.
    """

    lower: float
    upper: float
    omega: float
    Delta: Array
    message: str
    level: float = 0.0
    proof: PeakProof | None = None


def worst_case_gain(
    system: Any, structure: Structure | None = None, tolerance: float = 1e-2
) -> WorstCaseGain:
    """Certified bounds of the worst-case gain of an uncertain system.

    The complex performance block makes mu continuous over frequency, so a structure of real scalars
    needs no complex part.

    Parameters
    ----------
    system
        N, a stable continuous-time StateSpace or TransferFunction with outputs (perturbation,
        performance) and inputs (perturbation, exogenous); or an uncertain system.
    structure
        Blocks of the perturbation alone; None: those of the uncertain system.
    tolerance
        Relative distance that the proven gain may lie above the largest upper bound at any one
        frequency.

    Raises
    ------
    InputError
        As `peak`; the system has no performance outputs or no exogenous inputs.
    ContradictionError
        The lower bound is above the upper one.
    """
    need_tolerance(tolerance)
    if isinstance(system, UncertainPart) and structure is None:
        system, structure = system.system, system.structure
    need_structure(structure)
    assert structure is not None
    stable = stable_system(system)
    performance = stable.D.shape[0] - structure.columns
    exogenous = stable.D.shape[1] - structure.rows
    if performance < 1 or exogenous < 1:
        raise InputError(
            f"the system has {stable.D.shape[0]} outputs and {stable.D.shape[1]} inputs, of which "
            f"the perturbation takes {structure.columns} and {structure.rows}; at least one of "
            "each must be left for performance"
        )
    search = _Search(stable, structure, structure.with_performance(performance, exogenous))
    level, proof, message = search.proven(tolerance)
    upper = math.inf if proof is None else level * proof.beta * LEVEL_ROUNDING
    lower, omega, Delta = search.attained()
    need_agreement(
        lower,
        upper,
        "the worst-case gain",
        "ball arithmetic proves that a perturbation of size 1 has this gain",
        "multipliers prove it on intervals that cover all frequencies",
    )
    return WorstCaseGain(lower, upper, omega, Delta, message, level, proof)


class _Search:
    """The frequencies (F,) [rad/s] bounded so far and their upper bounds (F,) of the gain."""

    def __init__(self, system: StableSystem, structure: Structure, whole: Structure) -> None:
        self.system, self.structure, self.whole = system, structure, whole
        self.omega, self.upper = np.empty(0), np.empty(0)
        self.add(starting_grid(system.poles))
        for _ in range(GRID_REFINEMENTS):
            self.add(self._wanted())

    def skew(self, omega: RealArray) -> Skew:
        """The skewed problem at frequencies (F,) [rad/s]: the performance block varies."""
        varies = np.arange(len(self.whole)) == len(self.structure)
        return Skew(self.system.response(omega), self.whole, varies)

    def add(self, omega: RealArray) -> None:
        """Bound the gain at further frequencies (K,) [rad/s]."""
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
        least = NEGLIGIBLE_GAIN * float(np.abs(self.system.response(self.omega)).max())
        if least == 0.0:  # a rational function with this many zeros is the zero function
            return 0.0, PeakProof(0.0, ()), "the response is zero"
        level, precision = max(float(self.upper.max()), least), math.inf
        for _ in range(PROOF_LEVELS):
            place = float(self.omega[np.argmax(self.upper)])
            if math.isinf(level):
                message = (
                    "robust stability is not proven: mu of the perturbation is not below 1 at "
                    f"{place:.6g} rad/s"
                )
                return 0.0, None, message
            level *= 1 + tolerance / 2
            scaled = divided(self.system, self.structure, level)
            # The tolerance of the peak may use half of the distance of mu from 1 at this place.
            here = float(upper_values(scaled.response([place]), self.whole)[0])
            precision = min(precision, max((1 - here) / 2, 1e-6), 1e-2)
            found = peak(scaled, self.whole, precision)
            if found.upper < 1:
                return level, found.proof, found.message
            self.add(np.array([found.omega]))
            self.add(self._wanted())
            level = max(level, float(self.upper.max()))
            precision /= 2
        return 0.0, None, f"robust stability is not proven: no gain below {level:.6g} is"

    def attained(self) -> tuple[float, float, Array]:
        """The largest gain proven, its frequency and its perturbation."""
        best = np.argsort(-self.upper)[:PERTURBED_FREQUENCIES]
        omega = self.omega[best]
        lower, Delta = self.skew(omega).lower(self.upper[best])
        r, c = self.structure.rows, self.structure.columns
        Delta = np.where((lower > 0)[:, None, None], Delta[:, :r, :c], 0.0)
        gains = [
            attained_gain(self.system, self.structure, *one)
            for one in zip(Delta, omega, strict=True)
        ]
        index = int(np.argmax(gains))
        return gains[index], float(omega[index]), Delta[index]


def divided(system: StableSystem, structure: Structure, level: float) -> StableSystem:
    """The system with its exogenous inputs divided by a level."""
    scale = np.ones(system.D.shape[1])
    scale[structure.rows :] /= level
    outputs, inputs = (np.arange(count) for count in system.D.shape)
    return system.channels(outputs, inputs, input_gains=scale)


def attained_gain(system: StableSystem, structure: Structure, Delta: Array, omega: float) -> float:
    """The gain that a perturbation proves at a frequency [rad/s]; infinite if it destabilises.

    A multiple of at most 1 of it then makes the loop singular at some frequency.
    """
    r, c = structure.rows, structure.columns
    loop = system.channels(np.arange(c), np.arange(r))
    gain = proven_gain(system, structure, Delta, float(omega))
    if not Delta.any():
        return gain
    unstable = max(
        proven_at(loop, structure, Delta, float(omega)),
        proven_over_frequency(loop, structure, Delta),
    )
    return math.inf if unstable >= 1 else gain
