"""What must hold of the position estimators, by arithmetic of its own.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from workbench import Check
from workbench.arrays import RealArray
from workbench.heavy_types import Dataset
from workbench.simulation import sampled

from ...drive.plants import nominal_parameters, plant, total_gain
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD

PRINTED_POLES = -np.array([0.8955, 0.3764 + 1.2920j, 0.3764 - 1.2920j, 0.5758 + 0.5339j])
"""Of equation 7.33, without the last one's conjugate."""
BANDWIDTH = 2 * np.pi * 5000.0
"""obs_bw of section 7.3.3 [rad/s]."""
GAINS_AGREE = 0.15
"""Largest deviation from eq. 7.34: its realisation is not stated."""
SPIKE = {"focus": 1e-6, "radial": 0.1e-6}
"""The spike of section 7.3.3 [m]; radially the same share of the error that can be read."""


def checks_of(answer: Dataset, axis: Axis, rotation: float) -> list[Check]:
    """Named checks of a study of one axis."""
    kalman = answer["error"].sel(estimator="Kalman", size="largest")
    known, adapted = kalman.sel(case="known"), kalman.sel(case="adapted")
    drives = answer["drive_error"].sel(rival="Kalman", phase="during", size="largest")
    ratio = drives / answer["drive_measured"].sel(phase="during", size="largest")
    followed = abs(answer["followed"][:, -1] / rotation - 1).max()
    lost = int(answer["nominal_events"]) + int(answer["events"].sum())
    exact = exact_companion_gain(axis)
    found = [
        Check("loop", "times that it was lost or regained, all drives", lost, 0.0),
        Check("quality, clean", "clean samples called bad", int(answer["false_alarms"]), 0.0),
        Check("quality, scratch", "covered samples trusted", int(answer["missed"]), 0.0),
        Check(
            "lens",
            "largest error of x, the nominal drive's answer to u [m]",
            float(answer["position_error"]),
            1e-9,
        ),
        Check(
            "K_obs",
            "distance from Ackermann's formula in exact arithmetic, relative",
            float(np.max(abs(answer["K_obs"].values / exact - 1))),
            1e-3,
        ),
        Check(
            "spike",
            "largest error of the Kalman filter in 5 ms after a scratch [m]",
            float(known.sel(phase="after")),
            SPIKE[axis],
        ),
        Check(
            "scratch",
            "largest error of the Kalman filter in a scratch over that of the measurement",
            float(known.sel(phase="during") / answer["error_measured"].sel(phase="during")[1]),
            0.5,
        ),
        Check(
            "adapted",
            "largest error with the rotation followed over that with it known, less 1",
            float((adapted / known).max()) - 1.0,
            0.5,
        ),
        Check(
            "wrong rotation",
            "rms error with the rotation followed over that with it wrong, the slow observer",
            _cured(answer),
            0.5,
        ),
        Check("rotation", "relative error of the frequency followed", float(followed), 2e-3),
        Check(
            "drives, scratch",
            "largest error of the nominal drive's Kalman filter over that of the measurement",
            float(ratio.max()),
            0.75,
            f"at {ratio['drive'].values[int(np.argmax(ratio.values))]}",
        ),
        Check(
            "drives, readable",
            "largest error of the nominal drive's Kalman filter in a scratch [m]",
            float(drives.max()),
            ACCEPTABLE_ERROR[axis],
            f"at {drives['drive'].values[int(np.argmax(drives.values))]}",
        ),
    ]
    if axis == "focus":
        off = float(abs(answer["K_obs"] / answer["K_obs_printed"] - 1).max())
        found.append(
            Check("equation 7.34", "largest deviation from a printed gain", off, GAINS_AGREE)
        )
    return found


def _cured(answer: Dataset) -> float:
    """What following the rotation leaves of the errors between scratches, of the slow observer."""
    quiet = answer["error"].sel(estimator="ITAE 300 Hz", phase="quiet", size="rms")
    return float(quiet.sel(case="adapted") / quiet.sel(case="wrong"))


def exact_companion_gain(axis: Axis) -> RealArray:
    """K_obs (5,) = phi(A) O^-1 (0, ..., 0, 1)' of the companion form, in rational arithmetic.

    phi has the printed poles of eq. 7.33 mapped by exp(s T).
    """
    system = sampled(plant(nominal_parameters(axis), total_gain(axis)), PERIOD)
    poles = np.exp(BANDWIDTH * PERIOD * np.append(PRINTED_POLES, PRINTED_POLES[-1].conj()))
    wanted, n = np.poly(poles).real, system.nstates
    denominator = np.poly(system.A)
    markov = [system.C @ np.linalg.matrix_power(system.A, k) @ system.B for k in range(n)]
    numerator = [
        sum(denominator[j] * float(markov[k - j][0, 0]) for j in range(k + 1)) for k in range(n)
    ]
    first = [-Fraction(float(value)) for value in denominator[1:]]
    rows = [[Fraction(float(value)) for value in numerator]]
    for _ in range(n - 1):
        rows.append(_times_companion(rows[-1], first))
    column = _solve(rows, [Fraction(int(k == n - 1)) for k in range(n)])
    total = [Fraction(0)] * n
    for coefficient in wanted:  # Horner: phi(A) column
        moved = [sum((a * b for a, b in zip(first, total, strict=True)), Fraction(0)), *total[:-1]]
        total = [m + Fraction(float(coefficient)) * c for m, c in zip(moved, column, strict=True)]
    return np.array([float(value) for value in total])


def _times_companion(row: list[Fraction], first: list[Fraction]) -> list[Fraction]:
    """row A for the companion matrix A with this first row and ones below its diagonal."""
    return [row[0] * one + below for one, below in zip(first, [*row[1:], Fraction(0)], strict=True)]


def _solve(matrix: list[list[Fraction]], right: list[Fraction]) -> list[Fraction]:
    """Gauss and Jordan, exactly."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for k in range(len(rows)):
        pivot = next(i for i in range(k, len(rows)) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i, row in enumerate(rows):
            if i != k:
                rows[i] = [a - row[k] * b for a, b in zip(row, rows[k], strict=True)]
    return [row[-1] for row in rows]
