"""Search for a controller of any order that satisfies several weights on the nominal plant.

Each weight must be satisfied separately. If each |W_i X_i| is at most 1, the norm of the stack of
d_i W_i X_i with scales d_i is at most |d|. So if no controller reaches a norm of the stack of |d|
or less, no controller satisfies all weights, whatever d is. Each scale grows with the norm of its
row, until each row is at most 1 or the weights are impossible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import WorkbenchError
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.demands import DemandWeight
from workbench.synthesis.demands.weighted_loop import weighted_loop
from workbench.synthesis.h_infinity.riccati import central_controller
from workbench.systems.realisation import realisation

ROUNDS, SLOWEST = 25, 0.99
"""Largest number of changes of the scales. A change is slow if more than this share of the norms'
excess over 1 remains.
"""
PATIENCE = 4
"""Number of slow changes after which the search ends."""
LEVEL_TOLERANCE = 1e-3
"""Relative width of the interval that contains the least norm of a stack."""
CERTAIN = 1.002
"""Weights count as impossible above this level, which exceeds 1 by more than that width."""

OFF_AXIS = 1e-3
"""Poles nearer to the axis than this share of `slow_pole` count as on the axis."""


@dataclass(frozen=True)
class Reach:
    """Result of the search for a controller that satisfies the weights on the nominal plant.

    Unlike an `HinfController`, it may lack a controller, and then says how far none can reach.

    ``K``, with u = K e, satisfies each weight, and ``rows`` are the weighted norms; K is None if no
    such controller was found. ``bound`` is a lower bound on the largest weighted norm of every
    controller.
    """

    K: StateSpace | None
    rows: tuple[float, ...]
    bound: float

    @property
    def impossible(self) -> bool:
        """Whether the bound says that no controller satisfies all weights."""
        return self.bound > CERTAIN


def nominal_reach(plant: Rational, weights: Sequence[DemandWeight], slow_pole: float) -> Reach:
    """Search for a controller of any order that satisfies each weight on a plant.

    Parameters
    ----------
    plant
        Plant from u to y, including delays; strictly proper.
    weights
        Weights; at least one is a weight of K S, which bounds the controller's gain.
    slow_pole
        Real part [rad/s] to which poles on the axis are moved, since Riccati equations need it.
        Controllers are designed for the moved plant and judged with the plant itself.
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
            found = central_controller(
                system.A, system.B, system.C, system.D, 1, 1, LEVEL_TOLERANCE
            )
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
    """The plant with its poles on the imaginary axis moved to the right.

    If they were moved to the left, the controller would cancel them, and they would stay on the
    axis in the true loop.
    """
    near = np.abs(plant.poles.real) < OFF_AXIS * slow_pole
    return replace(plant, poles=np.where(near, slow_pole + 1j * plant.poles.imag, plant.poles))


def row_norms(G: StateSpace, K: StateSpace, weights: Sequence[DemandWeight]) -> np.ndarray:
    """Certified norm of each weighted transfer function; infinite if the loop is unstable."""
    loop = weighted_loop(G, None, weights).close(K)
    if not stability_check(loop).holds:
        return np.full(len(weights), np.inf)
    try:
        return np.array([certified_norm(loop[k, 0]) for k in range(len(weights))])
    except (ArithmeticError, np.linalg.LinAlgError):  # poles on the axis, up to rounding
        return np.full(len(weights), np.inf)
