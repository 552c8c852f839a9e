"""The step that minimises the largest of several linear functions, and units for it."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray

SMALLEST_SLOPE = 1e-12
"""A slope below this share of the peak counts as zero, so it gives no unit."""


def known_units(units: RealArray, slope: RealArray, peak: float) -> RealArray:
    """Units of the parameters; where they are zero, the step that changes a bound by the peak."""
    steepest = np.abs(slope).max(axis=0)
    moved = steepest > SMALLEST_SLOPE * peak
    by_slope = np.where(moved, peak / np.where(moved, steepest, 1.0), 1.0)
    found: RealArray = np.where(units > 0, units, by_slope)
    return found


def minimax_step(
    hessian: RealArray,
    slope: RealArray,
    value: RealArray,
    radius: float,
    room: tuple[RealArray, RealArray] | None = None,
) -> tuple[RealArray, float, RealArray]:
    """The step d that minimises max(value + slope d) + d H d / 2 in a box, with G d <= h in `room`.

    Returns d, the level of the maximum, and the weights (multipliers) of the values in it.
    """
    import clarabel
    from scipy.sparse import block_diag, csc_matrix, triu

    n = len(hessian)
    values, vectors = np.linalg.eigh((hessian + hessian.T) / 2)
    convex = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    box = np.hstack([np.eye(n), np.zeros((n, 1))])
    rows = np.vstack([np.column_stack([slope, -np.ones(len(value))]), box, -box])
    sides = np.concatenate([-value, np.full(2 * n, radius)])
    if room is not None:
        rows = np.vstack([rows, np.hstack([room[0], np.zeros((len(room[0]), 1))])])
        sides = np.concatenate([sides, room[1]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solution = clarabel.DefaultSolver(
        csc_matrix(triu(block_diag([convex, csc_matrix((1, 1))]))),
        np.append(np.zeros(n), 1.0),
        csc_matrix(rows),
        sides,
        [clarabel.NonnegativeConeT(len(sides))],
        settings,
    ).solve()
    found = np.array(solution.x)
    return found[:n], float(found[n]), np.maximum(np.array(solution.z)[: len(value)], 0.0)
