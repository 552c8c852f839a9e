"""Random starts: random controllers, changed until the loop is stable.

BFGS lowers the real part of the loop's rightmost pole, and of the controller's own rightmost pole
if the controller must be stable (J. V. Burke, D. Henrion, A. S. Lewis, M. L. Overton, HIFOO, a
Matlab package for fixed-order controller design and H-infinity optimization, IFAC Symposium on
Robust Control Design (2006)).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.linalg import LinAlgError

from workbench._core.arrays import RealArray
from workbench.synthesis.families.free import FreeMatrices
from workbench.synthesis.mu.structured.nonsmooth.bfgs import bfgs_end
from workbench.synthesis.mu.structured.norm.loop_norm import LoopNorm
from workbench.systems.standard_plant import StandardPlant

MOST_STEPS = 200
"""Largest number of steps until the loop of a random controller is stable."""
WELL_STABLE = 0.02
"""Distance of the rightmost pole from the axis, relative to the plant's speed, that is enough."""
DECADES = 1.0
"""Standard deviation of the magnitude of random gains [decades]."""
UNSCALED_SHARE = 0.5
"""Share of the random controllers with gains of size one in the user's units, which are often
chosen so that the gains that matter are of that size.
"""


def stable_draws(
    norm: LoopNorm, family: FreeMatrices, rng: np.random.Generator, count: int
) -> Iterator[RealArray]:
    """Parameters (k,) of random controllers whose loops are stable; fewer where few become so.

    Controllers have gains of the plant's own sizes, or of size one.
    """
    speed, gains = sizes_of(norm.plant)
    n, m, p = family.order, family.inputs, family.outputs
    row, column = np.ones((n + p, 1)), np.ones((1, n + m))
    row[:n], column[0, :n] = math.sqrt(speed), math.sqrt(speed)
    for _ in range(count):
        units = row * column
        unscaled = rng.random() < UNSCALED_SHARE
        units[n:, n:] = 1.0 if unscaled else gains * 10.0 ** (DECADES * rng.normal())
        unit = units.ravel()
        start = unit * rng.normal(size=unit.size)
        rightmost = partial(_rightmost_pole, norm, family, speed, unit)
        y, _ = bfgs_end(rightmost, start / unit, MOST_STEPS, enough=-WELL_STABLE)
        if math.isfinite(norm.value(y * unit)):
            yield y * unit


def _rightmost_pole(
    norm: LoopNorm, family: FreeMatrices, speed: float, unit: RealArray, y: RealArray
) -> tuple[float, RealArray]:
    """Real part of the rightmost pole over the speed, and its derivatives by parameters in
    units.
    """
    P, n = norm.plant, family.order
    X = (unit * y).reshape(n + family.outputs, n + family.inputs)
    B = np.block([[np.zeros((P.states, n)), P.B2], [np.eye(n), np.zeros((n, P.controls))]])
    C = np.block([[np.zeros((n, P.states)), np.eye(n)], [P.C2, np.zeros((P.measurements, n))]])
    D = np.zeros((len(C), B.shape[1]))
    D[n:, n:] = P.D22
    A = np.zeros((P.states + n,) * 2)
    A[: P.states, : P.states] = P.A
    try:
        right = np.linalg.solve(np.eye(len(C)) - D @ X, C)
        left = np.linalg.solve((np.eye(B.shape[1]) - X @ D).T, B.T).T
        found = _rightmost_eigenvalue(A + B @ X @ right, left, right)
        if norm.demands.stable and n:
            own = np.zeros((n, n + family.outputs)), np.zeros((n + family.inputs, n))
            own[0][:, :n] = own[1][:n] = np.eye(n)
            found = max(found, _rightmost_eigenvalue(X[:n, :n], *own), key=lambda each: each[0])
    except LinAlgError:
        return math.inf, np.zeros(len(y))
    return found[0] / speed, found[1].ravel() * unit / speed


def _rightmost_eigenvalue(
    A: RealArray, left: RealArray, right: RealArray
) -> tuple[float, RealArray]:
    """Real part of A's rightmost eigenvalue, and its derivatives by X if A changes by left dX
    right.
    """
    values, vectors = np.linalg.eig(A)
    place = int(np.argmax(values.real))
    row = np.linalg.inv(vectors)[place]
    return float(values[place].real), np.outer(row @ left, right @ vectors[:, place]).real


def sizes_of(P: StandardPlant) -> tuple[float, RealArray]:
    """The plant's speed [rad/s], and the sizes (p, m) of gains from y to u that matter."""
    poles = np.abs(np.linalg.eigvals(P.A))
    poles = poles[poles > 1e-9 * poles.max(initial=0.0)]
    speed = float(np.exp(np.log(poles).mean())) if poles.size else 1.0
    inside = 1.03j * speed * np.eye(P.states) - P.A
    size = np.abs(P.C2 @ np.linalg.solve(inside, P.B2) + P.D22)
    row, column = np.linalg.norm(size, axis=1), np.linalg.norm(size, axis=0)
    least = 1e-6 * max(float(row.max()), np.finfo(float).tiny)
    row, column = np.maximum(row, least), np.maximum(column, least)
    return speed, float(np.linalg.norm(size) or 1.0) / np.outer(column, row)
