"""Gramians of stable systems, refined to many digits, with proven bounds of their errors.

Let P solve A P + P A' + B B' = 0 for a stable A, and let M be any symmetric matrix with the
residual R = A M + M A' + B B'. Then P - M is the integral of exp(A t) R exp(A' t), which lies
between -|R| X and |R| X for the X of A X + X A' = -1. For an approximate Y with A Y + Y A' = -1 + E
and |E| < 1, X is at most Y / (1 - |E|). In sampled time A P + P A' is A P A' - P. Corrections come
from doubles and are added in many digits; residuals are computed in balls, and nothing rests on the
corrections.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import THIS_SYSTEM, Check
from workbench.certify.balls import above
from workbench.certify.modes.modal_form import real_balls
from workbench.certify.stability import stability_check
from workbench.systems.balancing import balancing

MOST_CORRECTIONS = 80
"""Largest number of corrections of a Gramian; each gains at least the factor SLOWEST, mostly 1e10.
At 1e10, 1024 bits take 31. With half of them Gramians of nearly unstable systems are not found;
with twice as many they take longer.
"""
SLOWEST = 0.5
"""Refinement ends when a correction leaves more than this share of the residual. Refinement is of
no use then: rounding hides the rest, or the doubles err by as much as they correct. Half or double
ends it a step earlier or later.
"""
SMALL_DEFECT = 2.0**-10
"""Y is good enough once E is below this size; the proof needs 1/2. Half or double: the same number
of corrections, mostly, and bounds wider by a thousandth.
"""
PROOF_BITS = (128, 512)
"""Bits of the numbers with which a Lyapunov equation is tried as a proof of stability. Few systems
need the second. With half of all more systems are left to `FEW_STATES`; double takes longer.
"""
FEW_STATES = 24
"""Up to this many states, the Lyapunov equation is solved as n (n + 1) / 2 linear equations if
nothing else proves stability. There are 300 equations then. Half leaves some small systems
undecided; double takes 64 times as long.
"""


@dataclass(frozen=True, eq=False)
class EnclosedGramian:
    """A symmetric matrix of balls of radius 0 that approximates a Gramian.

    Their difference lies between minus and plus ``share`` times ``size``, in the order of
    semidefinite matrices.
    """

    middle: Any
    size: Any
    share: arb

    def lacks(self, place: int, other: int) -> arb:
        """A bound of the error of an entry."""
        one, two = (abs(self.size[k, k]) for k in (place, other))
        return self.share * (one * two).sqrt()


def enclosed_gramian(A: RealArray, B: RealArray, dt: float, bits: int) -> EnclosedGramian | None:
    """The controllability Gramian of a stable system to nearly `bits` bits.

    None if doubles cannot correct it, because poles are too near the boundary of stability.

    Parameters
    ----------
    A, B
        (n, n) and (n, m); A is proven to be stable.
    dt
        Sampling time [s]; 0: continuous time.
    """
    with ctx.workprec(bits):
        b = real_balls(B)
        wanted, unit = b * b.transpose(), real_balls(np.eye(len(A)))
        P = _refined(A, wanted, dt, 2.0 ** (8 - bits))
        Y = _refined(A, unit, dt, SMALL_DEFECT)
        if P is not None and Y is not None:
            defect = frobenius(_residual(A, Y, unit, dt))
            if defect < 0.5:
                share = frobenius(_residual(A, P, wanted, dt)) / (1 - defect)
                return EnclosedGramian(P, Y, share.upper())
        return _gramian_by_equations(A, wanted, dt) if len(A) <= FEW_STATES else None


def _residual(A: RealArray, P: Any, wanted: Any, dt: float) -> Any:
    a = real_balls(A)
    half = a * P
    if dt:
        return half * a.transpose() - P + wanted
    return half + half.transpose() + wanted


def _refined(A: RealArray, wanted: Any, dt: float, share: float) -> Any:
    """The solution whose residual is at most this share of ``wanted``; None if there is none."""
    solve: Callable[..., RealArray] = solve_discrete_lyapunov if dt else solve_continuous_lyapunov
    sign = 1.0 if dt else -1.0
    n = len(A)
    P, rest = arb_mat(n, n), wanted
    first = left = frobenius(rest)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # for poles within rounding of the boundary
        for _ in range(MOST_CORRECTIONS):
            if not left > share * first:
                return P
            try:
                step = solve(A, sign * rounded(rest / left.mid()))
            except (np.linalg.LinAlgError, ValueError, RuntimeWarning):
                return None
            if not np.isfinite(step).all():
                return None
            P = (P + real_balls((step + step.T) / 2) * left.mid()).mid()
            rest = _residual(A, P, wanted, dt)
            before, left = left, frobenius(rest)
            if not left < SLOWEST * before:
                return P if left <= share * 2.0**16 * first else None
    return P


def _gramian_by_equations(A: RealArray, wanted: Any, dt: float) -> EnclosedGramian | None:
    """As `enclosed_gramian`, from linear equations in the entries of the Gramian, in balls."""
    n, a = len(A), real_balls(A).tolist()
    pairs = [(i, j) for i in range(n) for j in range(i, n)]
    place = {pair: k for k, pair in enumerate(pairs)}
    matrix, right = arb_mat(len(pairs), len(pairs)), arb_mat(len(pairs), 1)
    for row, (i, j) in enumerate(pairs):
        right[row, 0] = -wanted[i, j]
        for k in range(n):
            if dt:
                for m in range(n):
                    matrix[row, place[min(k, m), max(k, m)]] += a[i][k] * a[j][m]
            else:
                matrix[row, place[min(k, j), max(k, j)]] += a[i][k]
                matrix[row, place[min(k, i), max(k, i)]] += a[j][k]
        if dt:
            matrix[row, row] -= 1
    try:
        found = matrix.solve(right)
    except ZeroDivisionError:
        return None
    P = arb_mat(n, n)
    for k, (i, j) in enumerate(pairs):
        P[i, j] = P[j, i] = found[k, 0]
    share = frobenius(P - P.mid())
    return EnclosedGramian(P.mid(), real_balls(np.eye(n)), share.upper())


def stability_proof(system: StateSpace) -> Check:
    """As `stability_check`; if discs around the poles prove nothing, a Lyapunov equation is used.

    A is stable if A Y + Y A' is negative definite for a positive definite Y.
    """
    found = stability_check(system)
    A = np.asarray(system.A, dtype=float)
    if found.holds or not np.isfinite(A).all():
        return found
    with np.errstate(all="ignore"):
        units = balancing(A, len(A))[0]
        A = A * units[:, None] / units
    dt = float(system.dt or 0.0)
    for bits in PROOF_BITS:
        Y = enclosed_gramian(A, np.eye(len(A)), dt, bits)
        if Y is None:
            continue
        with ctx.workprec(bits):
            if _positive_definite(Y.middle - Y.size * Y.share):
                statement = "whether no solution of a Lyapunov equation proves it"
                return Check(
                    "internal stability", statement, 0.0, 0.0, over=THIS_SYSTEM, proven=True
                )
    return found


def _positive_definite(matrix: Any) -> bool:
    """Whether Cholesky's method in balls, with the largest pivot first, proves positive
    definiteness.
    """
    rest = matrix.tolist()
    left = list(range(len(rest)))
    while left:
        pivot = max(left, key=lambda k: float(rest[k][k].mid()))
        if not rest[pivot][pivot] > 0:
            return False
        left.remove(pivot)
        for i in left:
            share = rest[i][pivot] / rest[pivot][pivot]
            for j in left:
                rest[i][j] = rest[i][j] - share * rest[pivot][j]
    return True


def frobenius(matrix: Any) -> arb:
    """An upper bound of the spectral norm: the Frobenius norm."""
    squares = (entry.abs_upper() ** 2 for entry in matrix.entries())
    return sum(squares, arb(0)).upper().sqrt().upper()


def rounded(matrix: Any) -> RealArray:
    """Midpoints, rounded."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([float(entry.mid()) for entry in matrix.entries()]).reshape(shape)


def rounded_gramian(gramian: EnclosedGramian) -> tuple[RealArray, RealArray]:
    """The Gramian in doubles, and bounds of the errors of its entries, both (n, n)."""
    n = gramian.middle.nrows()
    near = rounded(gramian.middle)
    error = np.zeros((n, n))
    for i in range(n):
        for j in range(i, n):
            rest = abs(gramian.middle[i, j] - arb(float(near[i, j])))
            error[i, j] = error[j, i] = above(rest + gramian.lacks(i, j))
    return near, error
