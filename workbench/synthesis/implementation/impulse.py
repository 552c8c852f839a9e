"""Absolute and squared sums of the impulse response of a cascade of second-order sections."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import sosfilt

from workbench._core.arrays import RealArray
from workbench.synthesis.implementation.second_order import Sections

SUMMED_SAMPLES = 20_000
"""Number of samples that are added one by one; the sum of later ones is bounded."""


def stable_sections(rows: RealArray) -> bool:
    """Whether the poles of each section (L, 6) lie within the unit circle.

    The test is the exact stability triangle of the coefficients a1 and a2.
    """
    a1, a2 = rows[:, 4], rows[:, 5]
    return bool(((np.abs(a2) < 1.0) & (np.abs(a1) < 1.0 + a2)).all())


def absolute_sum(rows: RealArray) -> float:
    """Upper bound on max |y| over all inputs with |u| <= 1; infinite for an unstable cascade."""
    if not stable_sections(rows):
        return math.inf
    impulse = np.zeros(SUMMED_SAMPLES)
    impulse[0] = 1.0
    return float(np.abs(sosfilt(rows, impulse)).sum()) + _bound_on_rest(rows)


def squared_sum(rows: RealArray) -> float:
    """Variance of the output for white noise of variance 1; infinite for an unstable cascade."""
    if not stable_sections(rows):
        return math.inf
    system = Sections(((rows,),), 1.0).system
    P = solve_discrete_lyapunov(system.A, system.B @ system.B.T, method="bilinear")
    return float((system.C @ P @ system.C.T + system.D @ system.D.T)[0, 0])


def _bound_on_rest(rows: RealArray) -> float:
    """Bound on the absolute sum of the samples after the first `SUMMED_SAMPLES`.

    By Cauchy and Schwarz, sum |h_k| <= sqrt(sum h_k^2 r^(-2k)) sqrt(sum r^(2k)). With r^2 the
    modulus of the largest pole, the bound is exact for a single mode.
    """
    system = Sections(((rows,),), 1.0).system
    radius = math.sqrt(float(np.abs(system.poles()).max()))
    state = np.linalg.matrix_power(system.A, SUMMED_SAMPLES - 1) @ system.B
    if not 0.0 < radius < 1.0 or not np.abs(state).max() > np.finfo(float).tiny:
        return 0.0 if radius < 1.0 else math.inf
    A = system.A / radius
    Q = solve_discrete_lyapunov(A.T, system.C.T @ system.C, method="bilinear")
    energy = float((state.T @ Q @ state)[0, 0])
    return math.sqrt(max(energy, 0.0) / (1.0 - radius**2))
