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
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.certify.agreement import need_agreement
from workbench.certify.balls import in_plane
from workbench.certify.stable_system import angular_frequency, stable_system
from workbench.errors import InputError
from workbench.input_checks import need_structure, need_tolerance
from workbench.mu.frequency.channels import even_channels
from workbench.mu.robust.skewed_bounds import (
    LEVEL_ROUNDING,
    WorstCaseChecker,
    WorstCaseGain,
    attained_gain,
)
from workbench.mu.robust.skewed_peak import SkewSearch
from workbench.structure import Structure
from workbench.systems.conversion import as_system
from workbench.systems.joints import UncertainPart
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.dead_time import need_no_dead_time
from workbench.uncertainty.algebra.system import UncertainSystem


def worst_case_gain(
    system: Any, structure: Structure | None = None, *, tolerance: float = 1e-2
) -> WorstCaseGain:
    """Certified bounds of the worst-case gain of an uncertain system.

    The complex performance block makes mu continuous over frequency, so a structure of real scalars
    needs no complex part.

    Parameters
    ----------
    system
        N, a stable StateSpace or TransferFunction with outputs (perturbation, performance) and
        inputs (perturbation, exogenous); or an uncertain system, for which the proof holds for its
        `even_channels`.
    structure
        Blocks of the perturbation alone; None: those of the uncertain system.
    tolerance
        Relative distance by which the proven gain may lie above the largest upper bound at any one
        frequency.

    Raises
    ------
    InputError
        As `peak`; the system has no performance outputs or no exogenous inputs, or it has known
        dead time: the message then names the call that bounds its gain.
    ContradictionError
        The lower bound is above the upper one.
    """
    need_tolerance(tolerance)
    if isinstance(system, UncertainSystem):
        need_no_dead_time(system.elements, "worst_case_gain", "its upper bound")
    if isinstance(system, UncertainSystem) and structure is None and system.without_effect:
        structure, system = system.structure, _without_influence(system)
    prepared = isinstance(system, UncertainSystem) and structure is None
    if isinstance(system, UncertainPart) and structure is None:
        system, structure = system.system, system.structure
    if structure is None:
        as_system(system, "system")
        raise InputError(
            "the system has no uncertain elements of its own: give the structure of its "
            "perturbation, or an uncertain system"
        )
    need_structure(structure)
    stable, period = stable_system(system, sampled=True), 0.0
    D = stable.D
    performance, exogenous = D.shape[0] - structure.columns, D.shape[1] - structure.rows
    if performance < 1 or exogenous < 1:
        raise InputError(
            f"the system has {D.shape[0]} outputs and {D.shape[1]} inputs, of which the "
            f"perturbation takes {structure.columns} and {structure.rows}; at least one of each "
            "must be left for performance"
        )
    whole = structure.with_performance(performance, exogenous)
    if prepared:
        stable, period = even_channels(system, whole)
        system = stable
    search = SkewSearch(stable, whole, np.arange(len(whole)) == len(structure))
    level, proof, message = search.proven(tolerance)
    upper = math.inf if proof is None else level * proof.beta * LEVEL_ROUNDING
    lower, omega, Delta = _attained(search, structure, period or stable.period)
    need_agreement(
        lower,
        upper,
        "the worst-case gain",
        "ball arithmetic proves that a perturbation of size 1 has this gain",
        "multipliers prove it on intervals that cover all frequencies",
    )
    found = WorstCaseGain(lower, upper, omega, Delta, message, level=level, proof=proof)
    return found.with_checker(WorstCaseChecker(system, structure, dt=period))


def _without_influence(system: UncertainSystem) -> StateSpace:
    """The system in which the channels of elements without effect are disconnected."""
    whole, idle, place = system.system, [], 0
    for block in system.structure:
        channels = list(range(place, place + block.rows))
        idle += channels if block.name in system.without_effect else []
        place += block.rows
    B, C, D = whole.B.copy(), whole.C.copy(), whole.D.copy()
    B[:, idle], C[idle], D[idle], D[:, idle] = 0.0, 0.0, 0.0, 0.0
    return realisation((whole.A, B, C, D), whole.dt or 0.0)


def _attained(
    search: SkewSearch, structure: Structure, period: float
) -> tuple[float, float, Array]:
    """The largest gain proven, its frequency [rad/s] and its perturbation."""
    lower, Delta, omega = search.candidates()
    omega = angular_frequency(omega, period)
    r, c = structure.rows, structure.columns
    Delta = np.where((lower > 0)[:, None, None], Delta[:, :r, :c], 0.0)
    gains = [
        attained_gain(search.system, structure, one, in_plane(there, period))
        for one, there in zip(Delta, omega, strict=True)
    ]
    index = int(np.argmax(gains))
    return gains[index], float(omega[index]), Delta[index]
