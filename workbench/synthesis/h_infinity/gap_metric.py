"""The gap metric between two plants, as a model-matching problem.

The directed gap is the least norm of G1 - G2 Q over stable Q, where G1 and G2 are the normalised
right coprime factors [N; M] (T. Georgiou, On the computation of the gap metric, Systems & Control
Letters 11 (1988) 253-257).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, RepeatedChecker
from workbench.certificate import Check, relative_excess
from workbench.certify.agreement import need_agreement
from workbench.certify.norms import certified_norm
from workbench.errors import SolverError
from workbench.input_checks import need_tolerance
from workbench.mu import NuGap, nu_gap
from workbench.second_opinion import energies
from workbench.second_opinion.distances import chordal_distance
from workbench.second_opinion.loops import SAMPLED_ROUNDING
from workbench.synthesis.h_infinity.riccati import central_controller
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.equations.riccati import right_factors
from workbench.systems.realisation import realisation, worst_pole

OVER = "at every frequency, for these two plants"
"""The frequencies and plants for which the bounds hold, in words."""
BELOW_IT = "the nu-gap is never above it"
"""The reason for the lower bound, in words."""
FACTORS_ROUNDING = 1e-9
"""Relative change of a bound that rounding of the coprime factors may cause."""
GRAPHS_ROUNDING = 1e-9
"""Distance that rounding may cause between the graphs of equal plants."""


@dataclass(frozen=True, repr=False)
class PlantGap(Answer):
    """Bounds on the gap of two plants, from 0 to 1: a Q gives the upper bound, the nu-gap the lower
    one.
    """

    lower: float
    upper: float


def gap_metric(first: Any, second: Any, *, tolerance: float = 1e-3) -> PlantGap:
    """The gap metric of two plants: the larger of both directed gaps, with certified norms.

    Parameters
    ----------
    first, second
        Plants as in `nu_gap`. The nu-gap is never larger than the gap.
    tolerance
        Relative accuracy of the least norm.

    Raises
    ------
    InputError, SolverError
        As in `nu_gap`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import gap_metric
    >>> gap = gap_metric(control.tf([1], [1, -0.001]), control.tf([1], [1, 0.001]))
    >>> bool(gap.upper < 0.01)
    True
    """
    need_tolerance(tolerance)
    below = nu_gap(first, second)
    systems = [as_system(one, name) for one, name in ((first, "first"), (second, "second"))]
    plane = [bilinear_continuous(one) if one.dt else one for one in systems]
    factors = right_factors(plane[0], "first"), right_factors(plane[1], "second")
    upper = max(_directed_gap(*factors, tolerance), _directed_gap(*factors[::-1], tolerance))
    # Both bounds are proven for the computed coprime factors, which have rounding errors.
    need_agreement(
        (1 - FACTORS_ROUNDING) * below.lower, upper, "the gap", BELOW_IT, "a stable Q reaches it"
    )
    again = partial(gap_metric, first, second, tolerance=tolerance)
    found = PlantGap(below.lower, max(min(upper, 1.0), below.lower))
    return found.with_checker(GapChecker(again, OVER, (systems[0], systems[1]), below))


@dataclass(frozen=True, eq=False)
class GapChecker(RepeatedChecker):
    """Computes a `PlantGap` again, and compares it with the distance of the plants' graphs in time
    domain.

    ``plants`` are the two plants, and ``below`` is their nu-gap.
    """

    plants: tuple[StateSpace, StateSpace]
    below: NuGap

    def second_opinion(self, answer: PlantGap) -> list[Check]:
        plane = [bilinear_continuous(one) if one.dt else one for one in self.plants]
        poles = np.abs(np.concatenate([one.poles() for one in plane]))
        rate = energies.UNIT * float(poles.max(initial=0.0) or 1.0)
        graphs = [energies.in_samples(one, rate) for one in plane]
        apart = max(energies.graph_distance(*graphs), energies.graph_distance(*graphs[::-1]))
        statement = "distance of the graphs in time over the claimed upper bound, less 1"
        apart = max(apart - GRAPHS_ROUNDING, 0.0)
        found = [
            Check(
                "graphs in time", statement, relative_excess(apart, answer.upper), SAMPLED_ROUNDING
            )
        ]
        if self.below.winding and 0.0 < self.below.omega < math.inf:
            omega = np.array([self.below.omega])
            chord = float(chordal_distance(*self.plants, omega)[0])
            statement = "claimed lower bound over the chordal distance at its frequency, less 1"
            value = relative_excess(answer.lower, chord)
            found.append(Check("chordal distance", statement, value, SAMPLED_ROUNDING))
        return found


def _directed_gap(G1: StateSpace, G2: StateSpace, tolerance: float) -> float:
    """The least certified norm of G1 - G2 Q for three Q: 0, 1, and one near the best."""
    m = G1.ninputs
    A = block_diag(G1.A, G2.A)
    n, k = G1.nstates, G2.nstates
    B = np.block([[G1.B, np.zeros((n, m))], [np.zeros((k, m)), -G2.B]])
    C = np.vstack([np.hstack([G1.C, G2.C]), np.zeros((m, n + k))])
    D = np.block([[G1.D, -G2.D], [np.eye(m), np.zeros((m, m))]])
    simple = min(1.0, certified_norm(G1 - G2))
    try:
        Q = realisation(central_controller(A, B, C, D, m, m, tolerance).K, 0.0)
    except SolverError:  # also if the least norm is 0, which the identity then reaches
        return simple
    return min(simple, certified_norm(G1 - G2 * Q)) if worst_pole(Q)[1] < 0 else simple
