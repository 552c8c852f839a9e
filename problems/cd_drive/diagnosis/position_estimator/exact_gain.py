"""The gain of equation 7.34 in exact rational arithmetic: a second opinion on `companion_gain`.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np

from workbench.simulation import sampled_model
from workbench.types import RealArray

from ...drive.plants import nominal_parameters, plant, total_gain
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD

PRINTED_POLES = -np.array([0.8955, 0.3764 + 1.2920j, 0.3764 - 1.2920j, 0.5758 + 0.5339j])
"""Poles of equation 7.33 over the bandwidth; the conjugate of the last one is left out."""
OBSERVER_BANDWIDTH = 2 * np.pi * 5000.0
"""Bandwidth of the observer, obs_bw of section 7.3.3 [rad/s]."""

_exact: Any = np.vectorize(lambda value: Fraction(float(value)), otypes=[object])


def exact_companion_gain(axis: Axis) -> RealArray:
    """K_obs (5,) = phi(A) O^-1 (0, ..., 0, 1)' of the companion form, in rational arithmetic.

    phi has the printed poles of eq. 7.33 mapped by exp(s T).
    """
    system = sampled_model(plant(nominal_parameters(axis), total_gain(axis)), PERIOD)
    poles = np.exp(OBSERVER_BANDWIDTH * PERIOD * np.append(PRINTED_POLES, PRINTED_POLES[-1].conj()))
    n, denominator = system.nstates, np.poly(system.A)
    markov = [system.C @ np.linalg.matrix_power(system.A, k) @ system.B for k in range(n)]
    numerator = [
        sum(denominator[j] * float(markov[k - j][0, 0]) for j in range(k + 1)) for k in range(n)
    ]
    A = _exact(np.vstack([-denominator[1:], np.eye(n)[:-1]]))
    observability = [_exact(numerator)]
    for _ in range(n - 1):
        observability.append(observability[-1] @ A)
    column = _solve(np.array(observability), _exact(np.eye(n)[-1]))
    gain = _exact(np.zeros(n))
    for coefficient in np.poly(poles).real:  # Horner: phi(A) column
        gain = A @ gain + Fraction(float(coefficient)) * column
    return gain.astype(float)


def _solve(matrix: Any, right: Any) -> Any:
    """Solution of a square system of fractions by Gauss-Jordan elimination, exactly."""
    rows = np.column_stack([matrix, right])
    for k in range(len(rows)):
        pivot = next(i for i in range(k, len(rows)) if rows[i, k])
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] = rows[k] / rows[k, k]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, k], rows[k])
    return rows[:, -1]
