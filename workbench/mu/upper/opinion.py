"""The second opinion of upper bounds of mu: perturbations that could refute them, and balls.

A perturbation refutes a bound only if ball arithmetic proves that it makes I - M Delta singular. A
result in plain NumPy is reported, but decides nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray
from workbench.certificate import Check
from workbench.certify.balls import balls
from workbench.certify.singularity import proven_bound
from workbench.executor.effort import tries
from workbench.mu.lower.bound import lower_bound
from workbench.second_opinion import SEED
from workbench.second_opinion.multipliers import inequality_holds
from workbench.second_opinion.perturbations import loop_eigenvalues, vertex_perturbations
from workbench.structure import Real, Structure

MOST_MATRICES = 8
"""Number of matrices of a batch that are tried: those with the largest bounds, and as many random
ones. A second opinion by other mathematics, on a sample. With half of them a wrong bound is found
less surely; double costs time.
"""
DRAWN = 8
"""Number of random perturbations for each matrix. Vertices are tried too. With half of them the
lower bounds of this opinion are smaller, and it finds less; double costs time.
"""
REAL_EIGENVALUE = 1e-9
"""An eigenvalue counts as real if its imaginary part is below this share of its size. It is 4.5
million roundings, as an ill-conditioned eigenvalue has. With half of it fewer count; with double of
it a complex pair may, and contradict a true bound by as little.
"""

Index = tuple[int, ...]


def tried_matrices(value: np.ndarray) -> list[Index]:
    """Indices of the matrices that are tried, the largest bound first."""
    order = np.argsort(-value, axis=None, kind="stable")
    drawn = np.random.default_rng(SEED).permutation(order[MOST_MATRICES // 2 :])
    places = [*order[: MOST_MATRICES // 2], *drawn[: MOST_MATRICES // 2]]
    return [tuple(int(i) for i in np.unravel_index(place, value.shape)) for place in places]


def witnesses(M: ComplexArray, structure: Structure, value: np.ndarray) -> ComplexArray:
    """The best perturbation found for each matrix tried (..., r, c), NaN for the others."""
    Delta = np.full((*value.shape, structure.rows, structure.columns), complex(np.nan))
    for place in tried_matrices(value):
        Delta[place] = lower_bound(M[place], structure).Delta
    return Delta


def opinion(
    matrices: ComplexArray, structure: Structure, bounds: Any, named: Callable[[Index], str]
) -> Sequence[Check]:
    """Checks of upper bounds by perturbations, stored and random, and by ball arithmetic.

    Parameters
    ----------
    matrices
        M (..., c, r).
    bounds
        The `UpperBound` of M.
    named
        Function that names a place in the batch.
    """
    value = np.asarray(bounds.value)
    proven, where, suggested, unproven = -np.inf, "", -np.inf, 0
    for place in tried_matrices(value):
        M, bound = matrices[place], float(value[place])
        given = [] if bounds.Delta is None else [bounds.Delta[place]]
        given = [Delta for Delta in given if np.isfinite(Delta).all()]
        for Delta in [*given, *drawn(M, structure)]:
            suggested = max(suggested, _relative_excess(1 / float(np.linalg.norm(Delta, 2)), bound))
            excess = _relative_excess(proven_bound(balls(M), structure, Delta), bound)
            if excess > proven:
                proven, where = excess, named(place)
        multipliers = bounds.D_left[place], bounds.D_right[place], bounds.G[place]
        unproven += not inequality_holds(M, *multipliers, bound)
    return [
        Check(
            "perturbations",
            "largest bound by a perturbation proven singular over the upper bound, less 1",
            proven,
            0.0,
            where=where,
            proven=True,
        ),
        Check(
            "perturbations, not proven",
            "largest bound by a perturbation singular only up to rounding over the upper bound, "
            "less 1; no limit",
            suggested,
            float(np.finfo(float).max),
        ),
        Check(
            "multipliers",
            "number of matrices whose inequality ball arithmetic does not prove",
            unproven,
            0.0,
            proven=True,
        ),
    ]


def drawn(M: ComplexArray, structure: Structure) -> list[ComplexArray]:
    """Random perturbations, each scaled by an eigenvalue of M Delta to make I - M Delta singular up
    to rounding.
    """
    found = []
    turning = not any(isinstance(block, Real) for block in structure)
    for Delta in vertex_perturbations(structure, tries(DRAWN)):
        values = loop_eigenvalues(M, Delta)
        if not turning:
            values = values[np.abs(values.imag) <= REAL_EIGENVALUE * np.abs(values)].real
        values = values[np.abs(values) > 0]
        if values.size:
            found.append(Delta / values[np.argmax(np.abs(values))])
    return found


def _relative_excess(lower: float, upper: float) -> float:
    """Relative excess of a lower bound over an upper one."""
    return (lower - upper) / max(upper, float(np.finfo(float).tiny))
