"""The least bound of mu that given multipliers D and G prove, rounded outward.

For fixed D and G the least bound is an eigenvalue,

    beta^2 = lambda_max( D_r^-1/2 (M^H D_l M + j (G M - M^H G^H)) D_r^-1/2 ),

computed in coordinates in which M and the diagonal of D are near 1. Scaling by powers of two gives
these coordinates, so only the arithmetic within them rounds. Where the bound of the rounding errors
is large, as for a nearly singular D, beta is found by bisection instead. Its test scales the rows
and columns of beta^2 D_r - A and bounds the error of every entry, so it also works there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import EPS, ComplexArray
from workbench.structure import Full, Real, Structure

CHUNK_MATRICES = 4096
"""Number of matrices bounded in one call; intermediate arrays need many times their memory. Half or
double changes memory and time only.
"""
ACCEPTED_ROUNDING = 1e-9
"""Rounding errors below this share of beta^2 are accepted without a search. They raise a bound by
half of it at most, far less than anybody quotes. With half of it more bounds are searched for;
double loosens bounds by 5e-10.
"""
SAID_ALLOWANCES = 3.0
"""Multiple of the rounding allowance in a bound that is reported, so that each processor can prove
it. Two ways of rounding differ from the exact value by at most one allowance each; the check takes
a third. With half of it another processor may fail to prove a bound that this one reported; double
loosens bounds by three more allowances.
"""
BISECTIONS = 45
"""Largest number of bisections of beta^2 on a logarithmic scale. From a factor 2^8, 45 reach 2^-42.
With half of them such bounds are loose by 1e-6; more are never made.
"""
WIDENING = 2.0**4
"""Factor from the distance of one guess to that of the next. With half of it more guesses are made,
with double of it fewer, and the interval that they leave takes a bisection less or more.
"""
SAID_SHARPNESS = 2.0**-34
"""Relative width of the interval of beta^2 at which the search for a reported bound ends: a
sixteenth of the rounding that is accepted without a search. With half of it a search takes a
bisection more; double loosens reported bounds by 3e-11.
"""
SHARPNESS = SAID_SHARPNESS / WIDENING**2
"""The same for a proven bound. The power of `WIDENING` lets the search for it try every beta that
the search for a reported bound tries.
"""
OFF_EDGE = 1 + 2.0**-20
"""Factor on the size of a multiplier before it is rounded to a power of two: multipliers of size 1,
which are common, then keep their scale when their last bit changes. Any factor between the rounding
of a double and the next common size does. Half or double changes nothing.
"""
ENOUGH_SHARP = 1.01
"""A search ends at this multiple of the sharpness, since the width with which it starts is rounded.
That rounding is below 2^-10. Without the margin a search takes one bisection more; half or double
changes nothing.
"""


def structured(
    structure: Structure, D_left: ComplexArray, D_right: ComplexArray, G: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """The multipliers of the structure nearest to the given ones.

    Parameters
    ----------
    D_left, D_right, G
        Shapes (..., c, c), (..., r, r) and (..., r, c).

    Returns
    -------
    D_left and D_right with the same Hermitian block of every repeated scalar and the same multiple
    of the identity for every full block; G Hermitian in the blocks of real scalars, zero elsewhere.
    """
    parts = tuple(np.zeros_like(part, dtype=complex) for part in (D_left, D_right, G))
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        first, second = D_left[..., column, column], D_right[..., row, row]
        if isinstance(block, Full):
            # Read the common multiple at one entry, since a mean of equal numbers may round.
            d = second[..., :1, :1].real
            parts[0][..., column, column] = d * np.eye(block.columns)
            parts[1][..., row, row] = d * np.eye(block.rows)
            continue
        mean = _hermitian((first + second) / 2)
        parts[0][..., column, column] = mean
        parts[1][..., row, row] = mean
        if isinstance(block, Real):
            parts[2][..., row, column] = _hermitian(G[..., row, column])
    return parts[0], parts[1], parts[2]


def certified_bound(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
    *,
    allowances: float = 1.0,
) -> NDArray[np.float64]:
    """The least bound that the structured part of the multipliers proves, rounded outward.

    The result has the shape (...) of the batch. It is infinite where D is not positive definite or
    where an entry is not finite. The allowance for rounding bounds the errors of the products, the
    Cholesky factor and the eigenvalues (Higham, Accuracy and Stability of Numerical Algorithms,
    ch. 3, 8, 10).

    Parameters
    ----------
    M
        Complex, shape (..., c, r).
    D_left, D_right, G
        Multipliers of shapes (..., c, c), (..., r, r) and (..., r, c).
    allowances
        Multiple of the allowance for rounding. One proves the bound; a bound that is reported takes
        `SAID_ALLOWANCES`, since another processor, which rounds differently, must be able to prove
        it too.
    """
    multipliers = structured(structure, D_left, D_right, G)
    return structured_bound(M, structure, *multipliers, allowances=allowances)


def said_bound(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
) -> NDArray[np.float64]:
    """As `certified_bound`, with enough allowance that every processor can prove the bound
    again.
    """
    return certified_bound(M, structure, D_left, D_right, G, allowances=SAID_ALLOWANCES)


def structured_bound(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
    *,
    allowances: float = 1.0,
) -> NDArray[np.float64]:
    """As `certified_bound`, for multipliers that come from `structured`."""
    batch = M.shape[:-2]
    parts = [np.reshape(part, (-1, *part.shape[-2:])) for part in (M, D_left, D_right, G)]
    value = np.empty(len(parts[0]))
    for start in range(0, len(value), CHUNK_MATRICES):
        some = slice(start, start + CHUNK_MATRICES)
        M, D_left, D_right, G = (part[some] for part in parts)
        value[some] = _certified_chunk(M, structure, D_left, D_right, G, allowances)
    return value.reshape(batch)


def _certified_chunk(
    M: ComplexArray,
    structure: Structure,
    D_left: ComplexArray,
    D_right: ComplexArray,
    G: ComplexArray,
    allowances: float,
) -> NDArray[np.float64]:
    """As `certified_bound`, for a chunk (F, c, r) and multipliers exactly of the structure."""
    with np.errstate(all="ignore"):
        size = _power(np.abs(M).max((-2, -1), initial=0.0))
        rows, columns = (_power(OFF_EDGE * np.sqrt(_diagonal(D))) for D in (D_left, D_right))
        # Apply the factors one after the other, so that no product of two of them overflows.
        X = M / size[..., None, None] * rows[..., :, None] / columns[..., None, :]
        D = D_left / rows[..., :, None] / rows[..., None, :]
        R = D_right / columns[..., :, None] / columns[..., None, :]
        Y = G / size[..., None, None] / columns[..., :, None] / rows[..., None, :]
        # Scale again: if the entries of D differ widely, M may be small in these coordinates.
        again = _power(np.maximum(_norm(X), np.sqrt(_norm(X) * _norm(Y))))
        X, Y = X / again[..., None, None], Y / again[..., None, None]

        proper = np.logical_and.reduce([_finite(part) for part in (X, Y, D, R)])
        if not proper.all():
            X, Y, D, R = (
                np.where(proper[..., None, None], part, np.eye(*part.shape[-2:]))
                for part in (X, Y, D, R)
            )
        A, spread = _products(X, Y, D, structure)
        proper, top, error = _largest(A, spread, R, structure, proper, allowances)
        square = np.maximum(top + allowances * error, 0.0)
        # A reported bound is searched for in fewer steps than a proven one: the least bound found
        # is taken.
        doubtful = proper & (error > allowances * ACCEPTED_ROUNDING * square)
        if doubtful.any():
            square = np.array(square)
            square[doubtful] = np.minimum(
                square[doubtful],
                _least_proven_level(
                    A[doubtful],
                    spread[doubtful],
                    R[doubtful],
                    allowances,
                    top[doubtful],
                ),
            )
        value = np.sqrt(square) * (1 + 8 * EPS * allowances) * again * size
    return np.where(proper & np.isfinite(value), value, np.inf)


def _products(
    X: ComplexArray, Y: ComplexArray, D: ComplexArray, structure: Structure
) -> tuple[ComplexArray, NDArray[np.float64]]:
    """A = X^H D X + j (Y X - X^H Y^H), and a bound of its entries' rounding errors over eps."""
    size = np.abs(X)
    if _diagonal_only(structure):
        d = _diagonal(D)[..., None]
        scaled, scaled_size = d * X, np.abs(d) * size
    else:
        scaled, scaled_size = D @ X, np.abs(D) @ size
    A, spread = X.conj().mT @ scaled, size.mT @ scaled_size
    if Y.any():
        twisted = 1j * (Y @ X)
        twisted_size = np.abs(Y) @ size
        A, spread = A + twisted + twisted.conj().mT, spread + twisted_size + twisted_size.mT
    return A, 4 * (sum(X.shape[-2:]) + 8) * spread


def _diagonal_only(structure: Structure) -> bool:
    """Whether all D are diagonal."""
    return all(isinstance(block, Full) or block.rows == 1 for block in structure)


def _largest(
    A: ComplexArray,
    spread: NDArray[np.float64],
    R: ComplexArray,
    structure: Structure,
    proper: NDArray[np.bool_],
    allowances: float,
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Whether R > 0, the largest eigenvalue of the pencil (A, R), and a bound of its error.

    R > 0 must hold with these allowances for rounding.
    """
    allowance = 4 * (2 * A.shape[-1] + 8) * EPS
    if _diagonal_only(structure):
        least = _diagonal(R).min(-1)
        proper = proper & (least > 0)
        root = np.where(proper[..., None], _diagonal(R), 1.0) ** -0.5
        N = A * root[..., :, None] * root[..., None, :]
        stretch = np.ones_like(least)
    else:
        # D_r > 0 implies D_l > 0, because both consist of the same blocks.
        values, vectors = np.linalg.eigh(R)
        room = allowance * _norm(R)
        proper = proper & (values[..., 0] > allowances * room)
        # The error uses one allowance only, so that a value that a check searches for is also
        # searched for when it is reported.
        least = values[..., 0] - room
        root = np.where(proper[..., None], values, 1.0) ** -0.5
        N = root[..., :, None] * (vectors.conj().mT @ A @ vectors) * root[..., None, :]
        stretch = 1 + _norm(R) / np.where(proper, least, 1.0)
    if not proper.all():
        N = np.where(proper[..., None, None], N, 0.0)
    rounding = EPS * _norm(spread) / np.where(proper, least, 1.0)
    top = np.asarray(np.linalg.eigvalsh(N)[..., -1], dtype=float)
    return proper, top, rounding + allowance * stretch * _norm(N)


def _least_proven_level(
    A: ComplexArray,
    spread: NDArray[np.float64],
    R: ComplexArray,
    allowances: float,
    guess: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Nearly the least t for which t R - A > 0 is proven despite rounding; infinite if there is
    none.

    The search starts at a guess (F,), or anywhere.
    """
    count = 4 * (2 * A.shape[-1] + 8)
    fixed, growing = spread + count * np.abs(A), count * np.abs(R)

    def scaled(
        t: NDArray[np.float64], at: NDArray[np.intp]
    ) -> tuple[ComplexArray, NDArray[np.float64], NDArray[np.float64]]:
        """t R - A for t (f,) and the indices of the matrices (f,), with scaled rows and columns.

        Also the scaling factors (f, r), and the bound that the least eigenvalue must exceed for a
        proof.
        """
        bound = fixed[at] + np.abs(t)[:, None, None] * growing[at]
        root = np.where(_diagonal(bound) > 0, _diagonal(bound) / count, 1.0) ** -0.5
        both = root[:, :, None] * root[:, None, :]
        S = (t[:, None, None] * R[at] - A[at]) * both
        S = np.where(np.isfinite(S), S, 0.0)
        return S, root, EPS * (_norm(bound * both) + count * _norm(S))

    def holds(t: NDArray[np.float64], at: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether t R - A > 0 is proven, for t (f,) and the indices of the matrices (f,)."""
        S, _, rounding = scaled(t, at)
        return np.asarray(np.linalg.eigvalsh(S)[:, 0] > allowances * rounding)

    # A Newton step leads to the least bound that will be reported. This guess is the same for all
    # allowances: the search for a proven bound must try every value that the other search tries.
    S, root, rounding = scaled(guess, np.arange(len(guess)))
    values, vectors = np.linalg.eigh(S)
    least = root * vectors[:, :, 0]
    slope = (least.conj() * (R @ least[:, :, None])[:, :, 0]).real.sum(-1)
    nearer = guess - (values[:, 0] - SAID_ALLOWANCES * rounding) / slope
    guess = np.where((guess > 0) & (nearer > 0) & np.isfinite(nearer), nearer, guess)

    sharp = SHARPNESS if allowances <= 1.0 else SAID_SHARPNESS
    low, high, found, held = _bounds_near_guess(holds, guess, sharp)
    rest = np.flatnonzero(~found)
    low[rest], high[rest], found[rest] = _bracket(lambda t, at: holds(t, rest[at]), rest.size)
    for _ in range(BISECTIONS):
        open_ = np.flatnonzero(found & (high - low > ENOUGH_SHARP * sharp * high))
        if not open_.size:
            break
        middle = np.sqrt(low[open_] * high[open_])
        passed = holds(middle, open_)
        low[open_] = np.where(passed, low[open_], middle)
        high[open_] = np.where(passed, middle, high[open_])
    # the search of a check ends at its sharpness above the least value it can prove
    if allowances > 1.0:
        high = high * (1 + 2 * SHARPNESS)
    return np.minimum(np.where(found, high, np.inf), held)


Test = Callable[[NDArray[np.float64], NDArray[np.intp]], NDArray[np.bool_]]
"""Whether t (f,) is proven for the matrices with some indices (f,)."""


def _bounds_near_guess(
    holds: Test, guess: NDArray[np.float64], sharp: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Bounds (F,) of the least t at which a test holds, near a guess, and where they were found.

    The third result (F,) is the least value tried if the test holds at all of them; otherwise it is
    infinite.
    """
    low, high, found = np.zeros_like(guess), np.zeros_like(guess), np.zeros(len(guess), bool)
    held = np.full_like(guess, np.inf)
    left = np.flatnonzero(guess > 0)
    below = holds(guess[left], left)
    for side, numbers in ((-1, left[below]), (1, left[~below])):
        last, share = guess.copy(), sharp
        while numbers.size and share < 1.0:
            t = guess[numbers] * (1 + side * share)
            passed = holds(t, numbers)
            inside = passed == (side > 0)  # the test changes between the last t and this one
            now = numbers[inside]
            found[now] = True
            ends = last[now], t[inside]
            low[now], high[now] = ends if side > 0 else ends[::-1]
            last[numbers] = t
            numbers, share = numbers[~inside], WIDENING * share
        if side < 0:
            held[numbers] = last[numbers]
    return low, high, found, held


def _bracket(
    holds: Test, count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Bounds (F,), a factor 2^8 apart, of the least t at which a test holds, and whether there is
    one.

    They lie between 2^-100 and 2^100; both are 0 if the test holds at 0.
    """
    low, high = np.full(count, 2.0**-108), np.full(count, 2.0**-100)
    every = np.arange(count)
    zero = holds(np.zeros(count), every) if count else np.zeros(0, bool)
    low[zero] = high[zero] = 0.0
    found = zero.copy()
    for _ in range(26):
        left = every[~found]
        if not left.size:
            break
        passed = holds(high[left], left)
        found[left] = passed
        more = left[~passed]
        low[more], high[more] = high[more], 256.0 * high[more]
    return low, high, found


def _hermitian(matrix: ComplexArray) -> ComplexArray:
    """The Hermitian part."""
    return (matrix + matrix.conj().mT) / 2


def _finite(matrix: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether all entries of each matrix are finite."""
    return np.asarray(np.isfinite(matrix).all((-2, -1)))


def _diagonal(matrix: NDArray[Any]) -> NDArray[np.float64]:
    """The real parts of each diagonal."""
    return np.diagonal(matrix, axis1=-2, axis2=-1).real


def _norm(matrix: NDArray[Any]) -> NDArray[np.float64]:
    """Frobenius norm of each matrix, computed without overflow of the squares of its entries."""
    if np.iscomplexobj(matrix):  # real and imaginary parts side by side
        matrix = np.ascontiguousarray(matrix).view(float)
    size = _power(np.abs(matrix).max((-2, -1), initial=0.0))
    return np.sqrt(((matrix / size[..., None, None]) ** 2).sum((-2, -1))) * size


def _power(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest power of two not above each positive value; 1 for zero."""
    exponent = np.frexp(values)[1] - 1
    return np.where(values > 0, np.ldexp(1.0, exponent), 1.0)
