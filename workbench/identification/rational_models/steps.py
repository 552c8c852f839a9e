"""Local refinements: damped Gauss-Newton steps, and linear regressions with instruments."""

from __future__ import annotations

import numpy as np
from scipy.linalg import null_space

from workbench._core.arrays import RealArray
from workbench.identification.rational_models.point import FitPoint

MOST_STEPS = 200
"""Most steps from one start."""
DAMPING_TRIALS = 12
"""Number of dampings tried, each ten times the last, before a point counts as a minimum."""
MIN_DAMPING = 1e-14
"""Smallest damping, relative to the largest curvature."""
SETTLED_MOVEMENT = 1e-5
"""Steps end at this distance from the optimum, in standard deviations."""
SETTLED_SHARE = 1e-13
"""The same limit relative to the norm of the whitened response, for rounding."""
AT_MARGIN = 1e-6
"""Distance of a pole from the margin of stability, relative to the margin, below which it is at the
margin.
"""
UNSEEN = 1e-10
"""A direction counts as undetermined if its singular value of the scaled slopes, relative to the
largest, is below this.
"""


def gauss_newton_minimum(point: FitPoint) -> FitPoint:
    """The minimum of the cost that Levenberg-Marquardt steps reach from a point."""
    damping = 1e-3
    for _ in range(MOST_STEPS):
        slopes, errors = point.slopes, point.errors
        free = _free_directions(point, slopes, errors)
        if not free.shape[1]:
            break
        reduced = slopes @ free
        size = np.linalg.norm(reduced, axis=0)
        size[size == 0] = 1.0
        U, s, Vt = np.linalg.svd(reduced / size, full_matrices=False)
        along = U.T @ errors
        seen = s > UNSEEN * s[0]
        movement = float(np.linalg.norm(along[seen]))
        if movement <= max(SETTLED_MOVEMENT, SETTLED_SHARE * point.structure.data.size):
            break
        after = None
        for _ in range(DAMPING_TRIALS):
            step = Vt.T @ (s / (s**2 + damping * s[0] ** 2) * along)
            with np.errstate(all="ignore"):  # a step that overflows is refused
                trial = _moved_if_finite(point, -free @ (step / size))
            if trial is not None and trial.cost < point.cost:
                after, damping = trial, max(damping / 30, MIN_DAMPING)
                break
            damping = max(10 * damping, 1e-10)
        if after is None:
            break
        point = after
    return point


def _moved_if_finite(point: FitPoint, change: RealArray) -> FitPoint | None:
    """The moved point; None if its numbers are not finite."""
    try:
        return point.moved(change)
    except (ValueError, np.linalg.LinAlgError):
        return None


def _free_directions(point: FitPoint, slopes: RealArray, errors: RealArray) -> RealArray:
    """Orthonormal directions (k, f) that the next step may use.

    A pole at the margin of stability must not cross it, nor a delay its bound: if the step would do
    so, it is kept at the bound to first order.
    """
    count = slopes.shape[1]
    held = held_rows(point)
    if not held.size:
        return np.eye(count)
    size = np.linalg.norm(slopes, axis=0)
    size[size == 0] = 1.0
    step = -np.linalg.lstsq(slopes / size, errors)[0] / size
    outward = held[held @ step < 0]
    return null_space(outward) if outward.size else np.eye(count)


def held_rows(point: FitPoint) -> RealArray:
    """Derivatives (rows, k) of the distances of those poles and delays that are at a bound.

    Rows have length 1. Coinciding poles have no row: their derivatives do not exist.
    """
    structure, n = point.structure, point.poles.size
    rows = []
    count = n + structure.free_delay
    if structure.stable and n:
        margin = structure.margin(point.poles)
        near = structure.distance(point.poles) <= margin * (1 + AT_MARGIN)
        slopes = point.basis.pole_slopes()
        for k in np.flatnonzero(near & (point.poles.imag >= 0)):
            turn = 1.0 if structure.sample_time is None else point.poles[k].conj()
            row = np.zeros(count)
            with np.errstate(invalid="ignore"):
                row[:n] = -(turn * slopes[k]).real
            length = np.linalg.norm(row)
            if np.isfinite(length) and length > 0:
                rows.append(row / length)
    if structure.delay_bounds is not None:
        low, high = structure.delay_bounds
        for bound, sign in ((low, 1.0), (high, -1.0)):
            if point.delay == bound:
                rows.append(sign * np.eye(count)[-1])
    return np.array(rows).reshape(len(rows), count)


def linear_step(point: FitPoint, instruments: RealArray, share: float = 1.0) -> FitPoint | None:
    """The point whose denominator solves a linearised equation error.

    The equation is sum z (N - D data) / D0 = 0 with instruments z (rows, n), each minus its fit by
    numerators; it is weighted by the present denominator. With the regressors themselves as
    instruments this is an iteration of C. K. Sanathanan and J. Koerner (IEEE Trans. Autom. Control
    8(1), 1963); with the slopes of the model it is one of refined instrumental variables, whose
    fixed points are minima of the cost (R. S. Blom and P. M. J. Van den Hof, CDC 2010). Only a
    fraction of the change is made. A free delay is not changed.
    """
    data = point.structure.data
    n = point.poles.size
    regressors = point.without_numerators(point.denominator_slopes(data.response))[:, :n]
    known = point.without_numerators(data.target[..., None])[:, 0]
    matrix, right = instruments.T @ regressors, instruments.T @ known
    scale = np.linalg.norm(regressors, axis=0)
    if not (scale > 0).all():
        return None
    change = np.linalg.lstsq(matrix / scale, right)[0] / scale
    if not np.isfinite(change).all():
        return None
    padded = np.append(share * change, np.zeros(int(point.structure.free_delay)))
    return _moved_if_finite(point, padded)
