"""Which of several weights a controller of any order keeps on the nominal plant, each by itself.

With scales d_i the norm of the stack of d_i W_i X_i is at most |d| where each |W_i X_i| is at most
1. So a level of the stack above |d| that no controller is below is one that the weights together
cannot have, whatever d is. Scales grow with the norms of their rows, until each row is at most 1 or
such a level is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_of
from workbench.errors import WorkbenchError
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.demands import DemandWeight
from workbench.synthesis.demands.weighted_loop import weighted_loop
from workbench.synthesis.h_infinity.riccati import central
from workbench.systems.realisation import realisation

ROUNDS, SLOWEST = 25, 0.99
"""Most changes of the scales; the search ends where one leaves more than this share of what the
norms exceed 1 by."""
PATIENCE = 4
"""Rounds of that kind before it ends."""
LEVEL_TOLERANCE = 1e-3
"""Relative width of the interval in which the least level of a stack is found."""
CERTAIN = 1.002
"""Level from which on weights count as impossible: above 1 by more than that width."""

OFF_AXIS = 1e-3
"""Poles nearer to the axis than this share of where they are moved to count as on it."""


@dataclass(frozen=True)
class Reach:
    """What was found of weights on the nominal plant.

    ``K`` keeps each weight, u = K e (None: no such controller was found), with the norms ``rows``
    of its rows. ``bound``: no controller keeps each weight over a number below it.
    """

    K: StateSpace | None
    rows: tuple[float, ...]
    bound: float

    @property
    def impossible(self) -> bool:
        """Whether the level says that no controller keeps all weights."""
        return self.bound > CERTAIN


def nominal_reach(plant: Rational, weights: Sequence[DemandWeight], slow_pole: float) -> Reach:
    """Whether a controller of any order keeps each of the weights on a plant.

    Parameters
    ----------
    plant
        From u to y, with its delays; strictly proper.
    weights
        One of K S or more, so that the controller's gain is bounded.
    slow_pole
        Where poles on the axis are moved to [rad/s], as Riccati equations need it. Controllers are
        made for that plant and judged with the plant itself.
    """
    G, near = plant.state_space(), poles_off_axis(plant, slow_pole).state_space()
    scales = np.ones(len(weights))
    bound, excess, slow = 0.0, np.inf, 0
    for _ in range(ROUNDS):
        rows = [
            one._replace(W=replace(one.W, gain=one.W.gain * float(d)))
            for one, d in zip(weights, scales, strict=True)
        ]
        system = weighted_loop(near, None, rows).system
        try:
            found = central(system.A, system.B, system.C, system.D, 1, 1, LEVEL_TOLERANCE)
        except WorkbenchError:
            break
        bound = max(bound, found.lower / float(np.linalg.norm(scales)))
        if bound > CERTAIN:
            break
        K = realisation(found.K, 0.0)
        norms = row_norms(G, K, weights)
        if norms.max() <= 1:
            return Reach(K, tuple(norms.tolist()), bound)
        if not np.isfinite(norms).all():
            break
        if norms.max() - 1 > SLOWEST * excess:
            slow += 1
            if slow > PATIENCE:
                break
        excess = float(norms.max()) - 1
        scales = scales * np.maximum(norms, 1e-3 * norms.max())
        scales = scales / np.linalg.norm(scales)
    return Reach(None, (), bound)


def poles_off_axis(plant: Rational, slow_pole: float) -> Rational:
    """The plant with its poles at the axis moved to the right of it.

    On the left they would be cancelled by the controller, and stay at the axis in the true loop.
    """
    near = np.abs(plant.poles.real) < OFF_AXIS * slow_pole
    return replace(plant, poles=np.where(near, slow_pole + 1j * plant.poles.imag, plant.poles))


def row_norms(G: StateSpace, K: StateSpace, weights: Sequence[DemandWeight]) -> np.ndarray:
    """Certified norms of each weighted transfer function; infinite where the loop is unstable."""
    loop = weighted_loop(G, None, weights).close(K)
    if not stability_of(loop).holds:
        return np.full(len(weights), np.inf)
    try:
        return np.array([certified_norm(loop[k, 0]) for k in range(len(weights))])
    except (ArithmeticError, np.linalg.LinAlgError):  # poles at the axis, up to rounding
        return np.full(len(weights), np.inf)
