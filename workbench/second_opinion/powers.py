"""Stability by powers of the transition matrix: no eigenvalue is computed."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from workbench._core.arrays import RealArray

SQUARINGS = 60
"""Number of squarings of the transition matrix; the loop is then 2^60 samples old."""
BITS = 512
"""Bits of the powers that are recomputed if doubles show growth."""
PRECISE_ROUNDING = 1e-15
"""Rounding in the growth over 2^SQUARINGS samples with these bits: a factor of e^1000 over the
whole time.
"""
MANY_STATES, FALLEN = 100, 1e-9
"""From this many states on, squaring ends early once the power of a loop is below this size."""
SPARED_ROUNDING = 100.0
"""Rounding errors per squaring, in units of n eps, that the growth of a stable loop may show."""


def growth(A: Any, dt: float | None) -> tuple[Any, Any]:
    """Logarithmic growth of x[k + 1] = A x[k] per sample, and how much rounding may add to it.

    In continuous time (dt is 0 or None) A is replaced by its Cayley transform (a + A) / (a - A),
    which is stable where A is. The growth is the limit of |S^k|^(1/k) (Gelfand), at k = 2^60: below
    0 for a stable loop, above 0 for an unstable one.

    Parameters
    ----------
    A
        Real or complex (n, n); in discrete time also several (..., n, n), with a result for each.
    dt
        Sampling time [s]; 0 or None in continuous time.
    """
    A = np.asarray(A)
    if A.ndim == 2 and A.size and np.isrealobj(A):
        return _growth_of_one(np.ascontiguousarray(A, dtype=float).tobytes(), len(A), dt)
    S = A if dt else cayley(A)
    n = S.shape[-1]
    if not n:
        return np.full(S.shape[:-2], -np.inf)[()], np.zeros(S.shape[:-2])[()]
    unit = SPARED_ROUNDING * n * float(np.finfo(float).eps)
    size, share = np.zeros(S.shape[:-2]), 1.0
    rounding = np.full(S.shape[:-2], unit)
    tiny = float(np.finfo(float).tiny)
    norm = np.linalg.norm(S, axis=(-2, -1))
    for _ in range(SQUARINGS):
        known = (norm > 0.0) & (norm < math.inf)
        with np.errstate(all="ignore"):  # 0 counts as -inf, and an overflow as inf, from then on
            size = size + share * np.log(norm)
            S = S / np.where(norm > 0.0, norm, 1.0)[..., None, None]
            S = S @ S
        share /= 2
        norm = np.linalg.norm(S, axis=(-2, -1))
        # The part of the square that cancels, because |S^2| is far below |S|^2, is lost to
        # rounding.
        rounding = rounding + np.where(known, share * unit / np.maximum(norm, tiny), 0.0)
    size = np.where(np.isnan(size), np.inf, size)
    return size[()], rounding[()]


@lru_cache(maxsize=4)  # two checks ask for the growth of the same loop
def _growth_of_one(entries: bytes, n: int, dt: float | None) -> tuple[float, float]:
    """As `growth`, for one real matrix; with many states it ends at the first power that has
    clearly decayed.

    The norm of no power falls below the limit.
    """
    A = np.frombuffer(entries).reshape(n, n)
    S = A if dt else cayley(A)
    size, share, rounding = 0.0, 1.0, SPARED_ROUNDING * n * float(np.finfo(float).eps)
    unit, tiny = rounding, float(np.finfo(float).tiny)
    norm = float(np.linalg.norm(S))
    for _ in range(SQUARINGS):
        if not 0.0 < norm < math.inf:
            return (-math.inf if norm == 0.0 else math.inf), rounding
        size += share * math.log(norm)
        fallen = size / share < math.log(FALLEN) and size < -SPARED_ROUNDING * rounding
        if fallen and n >= MANY_STATES:
            return size, rounding
        S = S / norm
        S = S @ S
        share /= 2
        norm = float(np.linalg.norm(S))
        # The part of the square that cancels, because |S^2| is far below |S|^2, is lost to
        # rounding.
        rounding += share * unit / max(norm, tiny)
    if rounding < size:
        A, a = (A, 0.0) if dt else _balanced(A)
        return growth_in_digits(A, a), PRECISE_ROUNDING
    return size, rounding


def growth_in_digits(A: Any, a: float) -> float:
    """As `growth`, over the same samples in BITS bits: rounding of doubles may look like growth.

    A (n, n) is an array or a `flint` matrix; ``a`` is the number of `cayley`, 0 in discrete time.
    """
    import flint

    with flint.ctx.workprec(BITS):
        S = in_digits(A) if isinstance(A, np.ndarray) else A
        if a:
            unit = a * in_digits(np.eye(S.nrows()))
            S = (unit - S).solve(unit + S).mid()
    return precise_growth(S)


def in_digits(matrix: RealArray) -> Any:
    """A matrix of doubles as a `flint` matrix."""
    import flint

    rows, columns = matrix.shape
    return flint.arb_mat(rows, columns, matrix.ravel().tolist())


def precise_growth(S: Any) -> float:
    """Logarithmic growth per sample under a `flint` transition matrix, in BITS bits."""
    import flint

    size, share = 0.0, 1.0
    with flint.ctx.workprec(BITS):
        for _ in range(SQUARINGS):
            largest = max(abs(entry) for entry in S.entries())
            if not largest > 0:
                return -math.inf
            size += share * float(largest.log())
            S = S / largest
            S = (S * S).mid()
            share /= 2
    return size


def closed_growth(loop: Any, Delta: RealArray) -> tuple[float, float]:
    """`growth` of a StateSpace whose first inputs and outputs are closed by a constant
    perturbation.

    If it grows in doubles, it is computed again in BITS bits, whose rounding does not look like
    growth.
    """
    import flint

    rows, columns = Delta.shape
    parts = loop.A, loop.B[:, :rows], loop.C[:columns], loop.D[:columns, :rows]
    A, B, C, D = (np.asarray(part, dtype=float) for part in parts)
    doubles = A + B @ Delta @ np.linalg.solve(np.eye(columns) - D @ Delta, C)
    found: tuple[float, float] = growth(doubles, loop.dt)
    if not found[1] < found[0] < math.inf:
        return found
    with flint.ctx.workprec(BITS):
        delta, one = in_digits(Delta), in_digits(np.eye(columns))
        inner = delta * (one - in_digits(D) * delta).solve(in_digits(C))
        closed = (in_digits(A) + in_digits(B) * inner).mid()
    return growth_in_digits(closed, 0.0 if loop.dt else _balanced(doubles)[1]), PRECISE_ROUNDING


def slowness(A: Any, other: Any) -> float:
    """Ratio of another system's sampling time to that of A; at most 1.

    The sampling time for a system in continuous time follows from its fastest pole.
    """
    own, its = (_balanced(np.asarray(one))[1] if np.size(one) else 0.0 for one in (A, other))
    return min(own / its, 1.0) if its else 1.0


def cayley(A: Any) -> RealArray:
    """(a + A) / (a - A) with balanced states; `a` is larger than every pole, so that a - A is
    regular.
    """
    A = np.asarray(A)
    if not A.size:
        return A
    A, a = _balanced(A)
    unit = np.eye(len(A))
    return np.linalg.solve(a * unit - A, a * unit + A)


def _balanced(A: RealArray) -> tuple[RealArray, float]:
    """A with balanced states, by powers of two, and a number larger than every pole's size."""
    from scipy.linalg import matrix_balance

    A = matrix_balance(A, permute=False)[0]
    return A, 2.0 * float(np.linalg.norm(A, 2)) or 1.0


DOUBLINGS = 64
"""Number of doublings of the time that is summed; a sum that still changes then never ends."""


def root_energy(A: Any, B: Any, C: Any, D: Any, dt: float) -> float:
    """The H2 norm of a stable system; D must be 0 in continuous time.

    Q is the sum of (A^k)' C'C A^k, taken in blocks that double in length (R. A. Smith, Matrix
    equation XA + BX = C, SIAM J. Appl. Math. 16 (1968) 198-201). A continuous system is sampled by
    the Cayley transform (a + A) / (a - A), with the output sqrt(2 a) C / (a - A).
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (A, B, C, D))
    if not len(A):
        return float(np.linalg.norm(D))
    A, (scale, _) = matrix_balance(A, permute=False, separate=True)
    B = B / scale[:, None]
    Q = _summed(A.T, (C * scale).T, dt)
    return float(math.sqrt(max(float(np.trace(B.T @ Q @ B)) + float(np.sum(D**2)), 0.0)))


SUM_ROUNDING = 1e-6
"""Largest relative difference between an entry of a sum and the value it is compared with."""
FEW_STATES, SUM_BITS = 40, 192
"""Up to this many states, a sum is computed in this many bits; with more states, in doubles."""


def summed_gramians(A: Any, B: Any, C: Any, dt: float) -> tuple[RealArray, RealArray]:
    """The controllability and the observability Gramian of a stable system, as sums over samples.

    As in `root_energy`: sampling by the Cayley transform with sqrt(2 a) B / (a - A) preserves the
    first Gramian, and with sqrt(2 a) C / (a - A) the second one.
    """
    A, B, C = (np.asarray(part, dtype=float) for part in (A, B, C))
    n = len(A)
    if not n:
        return np.zeros((0, 0)), np.zeros((0, 0))
    A, (scale, _) = matrix_balance(A, permute=False, separate=True)
    P = _summed(A, B / scale[:, None], dt)
    Q = _summed(A.T, (C * scale).T, dt)
    return scale[:, None] * P * scale, Q / scale / scale[:, None]


def _summed(A: RealArray, B: RealArray, dt: float) -> RealArray:
    """The sum of A^k B B' (A^k)' over all samples."""
    unit, n = float(np.abs(B).max(initial=0.0)) or 1.0, len(A)
    rates = np.abs(np.linalg.eigvals(A))
    a = float(np.exp(np.mean(np.log(np.maximum(rates, 1e-12 * rates.max())))))
    if n <= FEW_STATES:
        return unit**2 * _summed_in_digits(A, B / unit, 0.0 if dt else a)
    S: Any = A
    b: Any = B / unit
    if not dt:
        away = a * np.eye(n) - A
        S = np.linalg.solve(away, a * np.eye(n) + A)
        b = np.linalg.solve(away, math.sqrt(2.0 * a) * b)
    total = b @ b.T
    for _ in range(DOUBLINGS):
        more = S @ total @ S.T
        total, S = total + more, S @ S
        if np.abs(more).max() <= np.finfo(float).eps * np.abs(total).max():
            break
    found: RealArray = unit**2 * total
    return found


def _summed_in_digits(A: RealArray, B: RealArray, a: float) -> RealArray:
    """As `_summed`, in SUM_BITS bits; if a > 0, for a continuous system sampled by the Cayley
    transform.
    """
    import flint

    n, m = B.shape
    with flint.ctx.workprec(SUM_BITS):
        S = flint.arb_mat(n, n, A.ravel().tolist())
        b = flint.arb_mat(n, m, B.ravel().tolist())
        if a:
            unit = a * flint.arb_mat(np.eye(n).tolist())
            away, root = unit - S, flint.arb(2.0 * a).sqrt()
            S, b = away.solve(unit + S).mid(), away.solve(root * b).mid()
        total = (b * b.transpose()).mid()
        for _ in range(DOUBLINGS):
            more = (S * total * S.transpose()).mid()
            total, S = total + more, (S * S).mid()
            sizes = [max(float(abs(x)) for x in part.entries()) for part in (more, total)]
            if sizes[0] <= np.finfo(float).eps ** 2 * sizes[1]:
                break
        return np.array([float(x) for x in total.entries()]).reshape(n, n)


def summed_hankel_values(A: Any, B: Any, C: Any, dt: float) -> tuple[RealArray, float]:
    """Hankel singular values from sums over samples, and the effect of rounding on the largest
    one.
    """
    P, Q = summed_gramians(A, B, C, dt)
    units = np.sqrt(np.sqrt(np.diagonal(Q).clip(1e-300) / np.diagonal(P).clip(1e-300)))
    P, Q = units[:, None] * P * units, Q / units / units[:, None]
    sizes, vectors = np.linalg.eigh((P + P.T) / 2)
    factor = vectors * np.sqrt(sizes.clip(0.0))
    squares = np.linalg.eigvalsh(factor.T @ ((Q + Q.T) / 2) @ factor).clip(0.0)[::-1]
    size = float(np.linalg.norm(P) * np.linalg.norm(Q))
    largest = float(squares.max(initial=0.0)) or 1.0
    return np.sqrt(squares), math.sqrt(100.0 * len(P) * float(np.finfo(float).eps) * size / largest)
