"""Proofs that multipliers bound mu of many matrices below one level.

Multipliers of a matrix often prove the same level for its neighbours. The proof is a Cholesky
factor that exists although more is subtracted than rounding may change.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import EPS
from workbench._core.compiled import unchecked, unchecked_kernel
from workbench.mu.upper.balance import power_of_two
from workbench.mu.upper.linear_algebra import factor, inner, inverse_from_factor
from workbench.mu.upper.newton import square
from workbench.mu.upper.pattern import slack

FALL = 0.9
"""Share of the possible decrease of t that is used, after a Cholesky factor has been found. All of
the fall would end on the border, where nothing can be inverted. Half or double of the distance from
1: larger falls nearer to the border, or smaller ones.
"""


@unchecked
def proven_below(
    batch: np.ndarray,
    level: float,
    left: np.ndarray,
    right: np.ndarray,
    D: np.ndarray,
    G: np.ndarray,
    source: np.ndarray,
    falls: int,
    value: np.ndarray,
) -> None:
    """Set value (F,) to bounds <= level that compact D and G (K, N, N) prove; infinite where they
    prove none.

    The multipliers of matrix f (c, r) have the index source[f]; D is positive definite. t = beta^2
    is proven by a Cholesky factor of S minus the possible rounding errors (see
    `_take_off_rounding`). As the least eigenvalue of the pencil (S, D_r) is no smaller than 1 /
    trace(S^-1 D_r), t may be reduced by that much; this is tried ``falls`` times.
    """
    c, r = batch.shape[1:]
    N = D.shape[1]
    Y, M = np.zeros((c, r), np.complex128), np.zeros((c, r), np.complex128)
    B, S, L, twist = square(r), square(r), square(r), square(N)
    work, inverse = square(r), square(r)
    sizes_Y, sizes = np.zeros((c, r)), np.zeros((r, r))
    scale = power_of_two(level)
    for f in range(len(batch)):
        t = (level / scale) ** 2
        for i in range(c):
            for j in range(r):
                M[i, j] = batch[f, i, j] / scale
        for i in range(N):
            for j in range(N):
                twist[i, j] = G[source[f], i, j] / scale
        slack(left, right, M, t, D[source[f]], twist, Y, B, S)
        _slack_sizes(left, right, M, t, D[source[f]], twist, sizes_Y, sizes)
        _take_off_rounding(S, sizes, EPS * 4 * (c + r + 8))
        value[f] = np.inf
        if not factor(S, L):
            continue
        for _ in range(falls):
            inverse_from_factor(L, work, inverse)
            fall = min(FALL / inner(inverse, B), t)
            for i in range(r):
                for j in range(r):
                    S[i, j] -= fall * B[i, j]
            if not factor(S, L):
                break
            t -= fall
        value[f] = np.sqrt(t) * scale


@unchecked_kernel
def _take_off_rounding(S: np.ndarray, sizes: np.ndarray, share: float) -> None:
    """Subtract an amount from the diagonal of S (r, r) such that a Cholesky factor of the result
    proves S > 0.

    A share of ``sizes`` bounds the errors of the entries of S. Errors up to E change S by no more
    than diag(E u / u) for any u > 0, here 1 / sqrt(S_ii), so that units do not matter. Those of the
    factor are below a share of sqrt(S_ii S_jj) (Higham, Accuracy and Stability, theorem 10.3).
    """
    r = S.shape[0]
    for i in range(r):
        sizes[i, i] /= S[i, i].real
    for i in range(r):
        for j in range(i):
            sizes[i, j] /= np.sqrt(S[i, i].real) * np.sqrt(S[j, j].real)
            sizes[j, i] = sizes[i, j]
    for i in range(r):
        total = float(r)
        for j in range(r):
            total += sizes[i, j]
        S[i, i] -= share * total * S[i, i].real


@unchecked_kernel
def _slack_sizes(
    left: np.ndarray,
    right: np.ndarray,
    M: np.ndarray,
    t: float,
    D: np.ndarray,
    G: np.ndarray,
    Y: np.ndarray,
    sizes: np.ndarray,
) -> None:
    """Set the lower half of ``sizes`` (r, r) to the sums of the sizes of all terms in the entries
    of `slack`; rounding errors are a share of these. ``Y`` (c, r) is work space.
    """
    c, r = M.shape
    for i in range(c):
        for j in range(r):
            Y[i, j] = _size(G[left[i], right[j]])
        for k in range(c):
            if left[i] != left[k] or i == k:
                for j in range(r):
                    Y[i, j] += 0.5 * _size(D[left[i], left[k]]) * _size(M[k, j])
    for i in range(r):
        for j in range(i + 1):
            same = right[i] == right[j] and i != j
            total = 0.0 if same else t * _size(D[right[i], right[j]])
            for k in range(c):
                total += _size(M[k, i]) * Y[k, j] + Y[k, i] * _size(M[k, j])
            sizes[i, j] = total


@unchecked_kernel
def _size(z: complex) -> float:
    """A number from the modulus of z to 1.42 times that, without a root."""
    return abs(z.real) + abs(z.imag)
