"""What no stable filter can do better: a lower bound of leakage and noise on the nominal plant.

T = F S may be any stable function, T = sum t_k z^k with z = (a - s) / (a + s). Where |W T - V| <= 1
at all frequencies, the lower triangular Toeplitz matrix of the first n coefficients of W T - V has
norm at most 1, whatever the others are; so has every vector that it is applied to, and the noise is
at least what these coefficients make. Least E + 3 rms over t_0 to t_(n-1) under such vectors is a
bound; vectors that violate it most are added in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import toeplitz

from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.systems.generalised_plant import response

from ...laboratory.bench_setup import NOISE
from .front import BAND, MICRO, solved
from .loop import FAST, MOST, SLOW, FaultLoop, disc_weight

CORNER = 2 * np.pi * 400.0
"""a [rad/s]."""
COEFFICIENTS = 64
CIRCLE = 2**14
"""Points at which moduli are given."""
FLOOR = 1e-2
"""Of weights that should be zero somewhere, in MICRO: outer functions are nowhere zero."""
STARTS = 24
"""Vectors to begin with, of so many frequencies."""
ROUNDS, CUTS, CLOSE = 25, 3, 0.02
"""Of adding vectors, how many for a limit, and the excess of a norm at which they end."""
OUTWARD = 1e-4
"""Of the bound, for the solver's accuracy, relative."""


@dataclass(frozen=True, eq=False)
class Limit:
    """|W T - V| <= 1, or <= E in MICRO: Toeplitz matrices (n, n) of W and of V."""

    W: RealArray
    V: RealArray
    leaks: bool


def least_total(loop: FaultLoop, error: float) -> float:
    """E + 3 rms [m] below which no stable filter comes with that relative error above FAST.

    Raises SolverError where the solver fails.
    """
    import cvxpy as cp

    theta = 2 * np.pi * (np.arange(CIRCLE) + 0.5) / CIRCLE
    omega = CORNER * np.abs(np.tan(theta / 2))
    f = omega / 2 / np.pi
    disc = np.abs(response(disc_weight(loop.axis), omega)[:, 0, 0]) / MICRO
    everywhere = _lower(_outer(np.full(CIRCLE, 1 / MOST)))
    relative = _lower(_outer(np.where(f >= FAST, 1 / error, 1 / (1 + MOST))))
    leaking = _lower(_outer(np.where(f <= SLOW, disc, FLOOR)))
    limits = [
        Limit(everywhere, 0 * everywhere, False),
        Limit(relative, relative, False),
        Limit(leaking, 0 * leaking, True),
    ]
    N, lost = _noise(loop, theta, f)
    t, E, rms = cp.Variable(COEFFICIENTS), cp.Variable(nonneg=True), cp.Variable(nonneg=True)
    held: list[Any] = [cp.norm(N @ t) <= rms, E >= MOST * FLOOR]
    waves = [_wave(angle) for angle in np.linspace(0.0, np.pi, STARTS)]
    held += [_held(limit, v, t, E) for limit in limits for v in waves]
    best = 0.0
    for _ in range(ROUNDS):
        problem = cp.Problem(cp.Minimize(E + 3 * rms), held)
        said = solved(problem)
        if t.value is None:
            raise SolverError(f"the bound of a relative error of {error:g}: {said}")
        best = max(best, float(problem.value) * (1 - OUTWARD))
        worst = 0.0
        for limit in limits:
            level = float(E.value) if limit.leaks else 1.0
            _, sizes, right = np.linalg.svd(limit.W @ _lower(t.value) - limit.V)
            worst = max(worst, sizes[0] / level - 1)
            held += [_held(limit, right[k], t, E) for k in range(CUTS) if sizes[k] > level]
        if worst < CLOSE:
            break
    # A filter that leaks less than E may is bounded with E in its leakage's place.
    return max(best - MOST * FLOOR - 3 * lost, 0.0) * MICRO


def _lower(column: Any) -> Any:
    """The lower triangular Toeplitz matrix of coefficients."""
    return toeplitz(column, np.zeros(len(column)))


def _outer(modulus: RealArray) -> RealArray:
    """The first coefficients of the outer function with a modulus on the circle."""
    log = np.fft.fft(np.log(modulus)) / CIRCLE
    # The points lie half a step from 1.
    k = np.arange(COEFFICIENTS)
    d = (log[:COEFFICIENTS] * np.exp(-1j * np.pi * k / CIRCLE)).real * np.where(k, 2.0, 1.0)
    w = np.zeros(COEFFICIENTS)
    w[0] = np.exp(d[0])
    for n in range(1, COEFFICIENTS):
        w[n] = (k[1 : n + 1] * d[1 : n + 1] * w[n - 1 :: -1][:n]).sum() / n
    return w


def _noise(loop: FaultLoop, theta: RealArray, f: RealArray) -> tuple[RealArray, float]:
    """Toeplitz matrix of the noise's weight in MICRO, and what its floor adds at most."""
    size = NOISE[loop.axis] / MICRO
    density = np.pi * size**2 / BAND * CORNER / (4 * np.pi) / np.cos(theta / 2) ** 2
    outside = f > BAND
    floor = FLOOR**2 * density[~outside].max()
    lost = MOST * np.sqrt(floor * outside.mean())
    return _lower(_outer(np.sqrt(np.where(outside, floor, density)))), float(lost)


def _wave(angle: float) -> Any:
    k = np.arange(COEFFICIENTS)
    window = np.sin(np.pi * (k + 0.5) / COEFFICIENTS)
    v = window * np.exp(1j * angle * k)
    return v / np.linalg.norm(v)


def _held(limit: Limit, v: Any, t: Any, E: Any) -> Any:
    """||(W T - V) v|| <= 1 or E, T v = Toeplitz(v) t."""
    import cvxpy as cp

    A, b = limit.W @ _lower(v), limit.V @ v
    rows, offset = np.vstack([A.real, A.imag]), np.concatenate([b.real, b.imag])
    return cp.norm(rows @ t - offset) <= (E if limit.leaks else 1.0)
