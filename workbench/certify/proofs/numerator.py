"""A stable system with the same gain as an unstable one at every frequency, up to a proven share.

For any F let N = (A + F C, B + F D, C, D) and M = (A + F C, F, C, I), so that G = M^-1 N. With a
symmetric X, W = I (in sampled time I + C X C') and S = X C' (in sampled time (A + F C) X C'),

    M M* = W + C Phi (F + S) + (...)* + C Phi R Phi* C',    Phi = (s - A - F C)^-1,
    R = (A + F C) X + X (A + F C)' + F F'    or    (A + F C) X (A + F C)' - X + F F',

on the boundary of stability. The X of a Riccati equation makes F + S and R zero: M is then inner up
to the factor W^1/2, and the singular values of W^-1/2 N are those of G (M. Vidyasagar, Control
System Synthesis: A Factorization Approach, MIT Press 1985, chapter 7). The rounding errors of F +
S, R and N are bounded here, so that the proof does not rest on the Riccati equation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import schur, solve_continuous_lyapunov, solve_discrete_lyapunov

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.norms import certified_norm
from workbench.certify.rounding import UPWARD, Enclosure, exact, nearest_power_of_two
from workbench.errors import InputError
from workbench.systems.balancing import speed, with_state_units
from workbench.systems.realisation import Matrices, matrices_of, realisation

LARGEST_SHARE = 0.1
"""Largest share of the gain that rounding may blur. A bound is then loose by 5 %, and a larger blur
says that unstable poles are hardly seen. Half or double refuses more or fewer of such systems.
"""


@dataclass(frozen=True, eq=False)
class Numerator:
    """A stable ``system`` whose gain is near that of an unstable one at every frequency.

    The peak of the unstable system differs from that of the stable one by at most the share
    ``share`` and the distance ``error``; see `enclosed`.
    """

    system: StateSpace
    error: float
    share: float

    def enclosed(self, lower: float, upper: float) -> tuple[float, float]:
        """Bounds of the peak of the unstable system, from bounds of the stable one's."""
        low = max(lower - self.error, 0.0) / math.sqrt(1.0 + self.share) / UPWARD_GAIN
        return low, (upper + self.error) / math.sqrt(1.0 - self.share) * UPWARD_GAIN


UPWARD_GAIN = 1.0 + 4 * EPS
"""Factor that covers the rounding of three operations with doubles, and its own."""


def stable_numerator(system: StateSpace) -> Numerator:
    """The system W^-1/2 N for a system without poles on the boundary of stability.

    Raises
    ------
    InputError
        Its unstable poles are hidden from its outputs, or too near the boundary for doubles.
    """
    dt = float(system.dt or 0.0)
    A, B, C, D = matrices_of(system)
    unit = float(nearest_power_of_two(max(np.abs(C).max(), np.abs(D).max())))
    A, B, C, D = with_state_units(A, B, C / unit, D / unit)
    rate = 1.0 if dt else speed(A, B, C)
    A, B = A / rate, B / rate
    try:
        X = _riccati(A, C, dt)
        weight = np.linalg.inv(np.linalg.cholesky(np.eye(len(C)) + C @ X @ C.T if dt else _one(C)))
    except (np.linalg.LinAlgError, ValueError):
        raise _hidden() from None
    S = A @ X @ C.T if dt else X @ C.T
    F = -S @ weight.T @ weight
    moved = exact(A) + exact(F) @ exact(C), exact(B) + exact(F) @ exact(D)
    seen = exact(weight) @ exact(C), exact(weight) @ exact(D)
    parts = moved[0].mid, moved[1].mid, seen[0].mid, seen[1].mid
    try:
        resolvent = certified_norm(_resolvent(parts, dt))
        entering = certified_norm(realisation((*parts[:2], _one(A), 0.0 * B), dt))
        leaving = certified_norm(realisation((parts[0], _one(A), C, 0.0 * C), dt))
    except InputError:  # a mirrored pole is not stable
        raise _hidden() from None
    blur = _size(moved[0], only_rounding=True) * resolvent
    if not blur < 0.5:
        raise _hidden()
    share = _share(moved[0], F, exact(C), X, exact(weight), dt, leaving / (1.0 - blur))
    if not share <= LARGEST_SHARE:
        raise _hidden()
    reached = entering / (1.0 - blur) * UPWARD
    into, out, direct = (_size(part, only_rounding=True) for part in (moved[1], *seen))
    size = (_size(seen[0]) + out) * UPWARD
    error = out * reached + size * resolvent * (blur / resolvent * reached + into) + direct
    found = rate * parts[0], rate * parts[1], unit * parts[2], unit * parts[3]
    return Numerator(realisation(found, dt), error * unit * UPWARD, share)


def _riccati(A: RealArray, C: RealArray, dt: float) -> RealArray:
    """The X whose feedback mirrors the unstable poles; it acts on their invariant subspace."""
    T, Q, k = schur(A, sort="ouc" if dt else "rhp")
    T, C1 = T[:k, :k], C @ Q[:, :k]
    if not k:
        return np.zeros_like(A)
    if dt:
        back = np.linalg.inv(T)
        seen = back.T @ C1.T @ C1 @ back
        Z = solve_discrete_lyapunov(back.T, seen)
    else:
        Z = solve_continuous_lyapunov(T.T, C1.T @ C1)
    root = np.linalg.cholesky((Z + Z.T) / 2)
    half = np.linalg.solve(root, Q[:, :k].T)
    X: RealArray = half.T @ half
    return X


def _share(
    A: Enclosure,
    F: RealArray,
    C: Enclosure,
    X: RealArray,
    weight: Enclosure,
    dt: float,
    leaving: float,
) -> float:
    """A bound of |K M M* K' - I|, with the weight K, if |C Phi| is at most `leaving`."""
    x = exact(X)
    seen = x @ C.H
    rest = exact(F) + (A @ seen if dt else seen)
    half = A @ x
    moved = half @ A.H - x if dt else half + half.H
    square = moved + exact(F) @ exact(F).H
    far = (2.0 * _size(rest) + _size(square) * leaving) * leaving
    one = exact(np.eye(len(C.mid)))
    inner = weight @ (one + C @ seen if dt else one) @ weight.H - one
    return (_size(inner) + _size(weight) ** 2 * far) * UPWARD


def _resolvent(parts: Matrices, dt: float) -> StateSpace:
    A, one = parts[0], _one(parts[0])
    return realisation((A, one, one, 0.0 * one), dt)


def _one(matrix: RealArray) -> RealArray:
    return np.eye(len(matrix))


def _size(matrix: Enclosure, *, only_rounding: bool = False) -> float:
    """A bound of the spectral norm by the Frobenius norm; or of the rounding error alone."""
    entries = matrix.rad if only_rounding else np.abs(matrix.mid) + matrix.rad
    return float(np.linalg.norm(entries)) * UPWARD + np.finfo(float).tiny


def _hidden() -> InputError:
    return InputError(
        "the system has an unstable pole that shows so little at its outputs, or lies so near the "
        "boundary of stability or so far from others, that doubles cannot tell its effect; take "
        "hidden states out first (workbench.realisations.minimal_realisation), or move the pole"
    )
