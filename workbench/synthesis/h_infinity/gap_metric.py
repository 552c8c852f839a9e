"""The gap between the graphs of two plants, as a model-matching problem.

The directed gap is the least norm of G1 - G2 Q over stable Q, G1 and G2 the normalised right
coprime factors [N; M] (T. Georgiou, On the computation of the gap metric, Systems & Control Letters
11 (1988) 253-257).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from workbench.answer import Answer, RepeatedChecker
from workbench.certify.norms import certified_norm
from workbench.errors import SolverError
from workbench.heavy_types import StateSpace
from workbench.input_checks import need_tolerance
from workbench.mu import nu_gap
from workbench.synthesis.h_infinity.riccati import central
from workbench.systems.bilinear import bilinear_continuous
from workbench.systems.conversion import as_system
from workbench.systems.realisation import realisation, worst_pole
from workbench.systems.riccati import right_factors


@dataclass(frozen=True, repr=False)
class PlantGap(Answer):
    """Bounds of the gap of two plants, from 0 to 1: above by a Q, below by the nu-gap."""

    lower: float
    upper: float


def gap_metric(first: Any, second: Any, tolerance: float = 1e-3) -> PlantGap:
    """The gap of two plants: the larger of both directed gaps, with certified norms.

    Parameters
    ----------
    first, second
        As in `nu_gap`, which is never above it.
    tolerance
        Relative accuracy of the least norm.

    Raises
    ------
    InputError, SolverError
        As `nu_gap`.

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
    upper = max(_directed(*factors, tolerance), _directed(*factors[::-1], tolerance))
    again = partial(gap_metric, first, second, tolerance)
    found = PlantGap(below.lower, max(min(upper, 1.0), below.lower))
    return found.checked_by(RepeatedChecker(again, "at every frequency, for these two plants"))


def _directed(G1: StateSpace, G2: StateSpace, tolerance: float) -> float:
    """The least certified norm of G1 - G2 Q for three Q: 0, 1, and one near the best."""
    m = G1.ninputs
    A = block_diag(G1.A, G2.A)
    n, k = G1.nstates, G2.nstates
    B = np.block([[G1.B, np.zeros((n, m))], [np.zeros((k, m)), -G2.B]])
    C = np.vstack([np.hstack([G1.C, G2.C]), np.zeros((m, n + k))])
    D = np.block([[G1.D, -G2.D], [np.eye(m), np.zeros((m, m))]])
    simple = min(1.0, certified_norm(G1 - G2))
    try:
        Q = realisation(central(A, B, C, D, m, m, tolerance).K, 0.0)
    except SolverError:  # also where the least norm is 0, which 1 has then
        return simple
    return min(simple, certified_norm(G1 - G2 * Q)) if worst_pole(Q)[1] < 0 else simple
