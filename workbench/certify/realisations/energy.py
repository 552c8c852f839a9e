"""The energy of a stable system's impulse response, enclosed by a Lyapunov equation's residual.

For a stable A let Q solve A'Q + QA + C'C = 0, and let Q^ be any symmetric matrix with the residual
R = A'Q^ + Q^A + C'C. Then Q - Q^ is the integral of exp(A't) R exp(At), which lies between -|R| X
and |R| X for the X of A'X + XA = -1. For an approximate X^ with A'X^ + X^A = -1 + E and |E| < 1, X
is at most X^ / (1 - |E|). So the energy tr(B'QB) is tr(B'Q^B) up to |R| tr(B'X^B) / (1 - |E|). In
sampled time A'Q + QA is A'QA - Q.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
from flint import ctx
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench.certify.balls import above, below
from workbench.certify.modes.modal_form import real_balls
from workbench.certify.realisations.lyapunov import enclosed_gramian
from workbench.certify.rounding import UPWARD, Enclosure, exact
from workbench.systems.balancing import with_state_units

LOOSE, MANY_BITS = 1e-9, 192
"""More digits are used if the slack exceeds this share of the energy; and their number of bits.
Energies are quoted to six digits at most, and 192 bits are 3.6 times those of a double. Half or
double changes how often, and the time.
"""
REFINEMENTS = 3
"""Number of solutions of the residual's Lyapunov equation that are added. Each gains the digits of
a double, less those of the condition number. With half of them bounds of ill-conditioned systems
take many digits; more change nothing.
"""


def energy_bounds(A: Any, B: Any, C: Any, dt: float) -> tuple[float, float]:
    """Bounds of tr(B'QB) for a system that is proven to be stable; (0, inf) if none are proven.

    Parameters
    ----------
    A, B, C
        (n, n), (n, m) and (p, n).
    dt
        Sampling time [s]; 0: continuous time.
    """
    A, B, C = (np.asarray(part, dtype=float) for part in (A, B, C))
    if not len(A):
        return 0.0, 0.0
    A, B, C, _ = with_state_units(A, B, C, np.zeros((len(C), B.shape[1])))
    solve = solve_discrete_lyapunov if dt else solve_continuous_lyapunov
    sign = 1.0 if dt else -1.0
    output = exact(C).H @ exact(C)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # for poles within rounding of the boundary
            X = _symmetric(solve(A.T, sign * np.eye(len(A))))
            Q = _symmetric(solve(A.T, sign * (C.T @ C)))
            for _ in range(REFINEMENTS):
                Q = Q + _symmetric(solve(A.T, sign * _residual(A, Q, output, dt).mid))
    except (np.linalg.LinAlgError, ValueError, RuntimeWarning):
        return _in_many_digits(A, B, C, dt)
    rest = _size(_residual(A, Q, output, dt))
    error = _size(_residual(A, X, exact(np.eye(len(A))), dt))
    if not error < 0.5:
        return _in_many_digits(A, B, C, dt)
    share = rest / (1.0 - error) * UPWARD
    energy, unit = _trace(B, Q), _trace(B, X)
    slack = share * (float(unit.mid[0, 0]) + float(unit.rad[0, 0])) * UPWARD
    slack = slack + float(energy.rad[0, 0])
    middle = float(energy.mid[0, 0])
    if slack > LOOSE * middle:
        return _in_many_digits(A, B, C, dt)
    low, high = np.nextafter(middle - slack, -np.inf), np.nextafter(middle + slack, np.inf)
    return (max(float(low), 0.0), float(high)) if math.isfinite(high) else (0.0, math.inf)


def _in_many_digits(A: RealArray, B: RealArray, C: RealArray, dt: float) -> tuple[float, float]:
    """The bounds from a Gramian with more digits than doubles have, for poles of very different
    speeds.
    """
    found = enclosed_gramian(A.T, C.T, dt, MANY_BITS)
    if found is None:
        return 0.0, math.inf
    with ctx.workprec(MANY_BITS):
        b = real_balls(B)
        energy, unit = ((b.transpose() * Q * b).trace() for Q in (found.middle, found.size))
        slack = abs(unit) * found.share
        low, high = below(energy - slack), above(energy + slack)
    return (max(low, 0.0), high) if math.isfinite(high) else (0.0, math.inf)


def _residual(A: RealArray, Q: RealArray, output: Enclosure, dt: float) -> Enclosure:
    """A'Q + QA plus the output term; in sampled time A'QA - Q plus the output term."""
    a, q = exact(A), exact(Q)
    if dt:
        return a.H @ q @ a - q + output
    half = q @ a
    return half + half.H + output


def _trace(B: RealArray, Q: RealArray) -> Enclosure:
    """The trace of B'QB, as a matrix with one entry."""
    whole = exact(B).H @ exact(Q) @ exact(B)
    place = np.arange(B.shape[1])
    row = Enclosure(whole.mid[place, place][None], whole.rad[place, place][None])
    return row @ exact(np.ones((B.shape[1], 1)))


def _size(matrix: Enclosure) -> float:
    """A bound of the spectral norm: the Frobenius norm, rounded up."""
    return float(np.linalg.norm(np.abs(matrix.mid) + matrix.rad)) * (1.0 + 1e-12)


def _symmetric(Q: RealArray) -> RealArray:
    found: RealArray = (Q + Q.T) / 2
    return found
