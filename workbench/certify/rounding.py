"""Matrix arithmetic in doubles that encloses the exact result: midpoints with radii.

Every entry of a matrix lies within its radius of its midpoint. An inner product of length k, in
any order of its terms, errs by at most gamma_k times the product of the absolute values (Higham,
Accuracy and Stability of Numerical Algorithms (2002), sections 3.1 and 3.6); the radii of a product
follow from those of its factors (Rump, Fast and parallel interval arithmetic, BIT 39 (1999)
534-554).
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, Array, RealArray

UPWARD = 1.0 + 2.0**-20
"""Factor on each computed radius. A sum of up to 2^30 nonnegative terms has a relative error of
2^-23. Half of the distance from 1 still covers it; double widens radii by another 1e-6 for each
operation.
"""
DOUBLE_BITS = sys.float_info.mant_dig
"""Bits of a double."""
TINY = float(np.finfo(float).tiny)
"""Smallest normal number, which bounds the absolute error of a product that underflows."""
BALL_BITS = 256
"""Bits of balls in proofs about numbers that are doubles: five times those of a double, so that
four fifths may cancel, as in polynomials over many decades of frequency. With half of them such
proofs fail; with twice as many they take longer. No number of bits makes them wrong.
"""
SLICES = 5
"""Number of slices of a matrix for a sharp product: five have 100 bits for 800 inner terms. With
half of them a test finds wrong last bits; with twice as many no test feels a difference.
"""
WEIGHTINGS = 6
"""Number of steps of the search for the weights x of an inverse. With half of them some inverses
may stay unproven in doubles, and are computed in balls.
"""
WANTED_CONTRACTION = 1e-3
"""A row needs no further weighting once its theta is below this. A bound is larger by 1 / (1 -
theta), so less gains nothing. Half or double changes weights a little; every weight gives a valid
bound.
"""
LARGEST_WEIGHT = 1e100
"""Largest ratio of two weights. Products of three weights are doubles. Half or double changes
nothing for a matrix in usual units.
"""


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Real or complex matrices whose entries lie within ``rad`` of ``mid``, both (m, n)."""

    mid: Array
    rad: RealArray

    def __matmul__(self, other: Enclosure) -> Enclosure:
        inner = self.mid.shape[1]
        size, others = np.abs(self.mid), np.abs(other.mid)
        # A complex product has twice as many real terms, in each of two parts.
        rad = (4 * (inner + 4) * EPS * size + self.rad) @ others + inner * TINY
        if other.rad.any():
            rad += (size + self.rad) @ other.rad
        return Enclosure(self.mid @ other.mid, rad * UPWARD)

    def __add__(self, other: Enclosure) -> Enclosure:
        mid = self.mid + other.mid
        return Enclosure(mid, (self.rad + other.rad + EPS * np.abs(mid)) * UPWARD)

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.mid, self.rad)

    def __sub__(self, other: Enclosure) -> Enclosure:
        return self + -other

    def __getitem__(self, place: Any) -> Enclosure:
        return Enclosure(self.mid[place], self.rad[place])

    def times(self, factor: Any) -> Enclosure:
        """The product with a real number, or entry by entry with an array of them."""
        mid = self.mid * factor
        rounds = np.frexp(factor)[0] != 0.5  # powers of two round nothing
        rad = self.rad * np.abs(factor) + np.where(rounds, 4 * EPS * np.abs(mid), 0.0)
        return Enclosure(mid, _above_underflow(mid, rad) * UPWARD)

    def scaled(self, rows: RealArray, columns: RealArray) -> Enclosure:
        """The rows and columns times powers of two, which round nothing except by underflow."""
        mid = self.mid * rows[:, None] * columns
        rad = self.rad * rows[:, None] * columns
        return Enclosure(mid, _above_underflow(mid, rad))

    @property
    def H(self) -> Enclosure:
        """The conjugate transpose."""
        return Enclosure(self.mid.conj().T, self.rad.T)

    @property
    def finite(self) -> bool:
        """Whether all midpoints and radii are finite."""
        return bool(np.isfinite(self.mid).all() and np.isfinite(self.rad).all())


def _above_underflow(mid: Array, rad: RealArray) -> RealArray:
    """The radii of products with one factor each, some of which may have underflowed."""
    low = (np.abs(mid) < TINY) & ((mid != 0) | (rad != 0))
    return np.where(low, rad + TINY, rad) if low.any() else rad


def exact(matrix: Array) -> Enclosure:
    """The matrix itself, without error."""
    return Enclosure(matrix, np.zeros(matrix.shape))


def stacked_enclosures(rows: list[list[Enclosure]]) -> Enclosure:
    """A matrix of blocks."""
    return Enclosure(
        np.block([[part.mid for part in row] for row in rows]),
        np.block([[part.rad for part in row] for row in rows]),
    )


def sharp_product(X: RealArray, Y: RealArray) -> Enclosure:
    """Enclosure of X Y for real matrices (m, k), (k, n), nearly as sharp if its terms cancel.

    Rows of X and columns of Y are scaled by powers of two to at most 1, and cut into slices of few
    bits each. Products of two slices are then sums of integers below 2^53 in one unit, so that no
    addition rounds, in any order (Ozaki, Ogita, Oishi, Rump, Error-free transformations of matrix
    multiplication by using fast routines of matrix multiplication, Numer. Algorithms 59 (2012)
    95-118).
    """
    X, Y, scale, below = _in_units(X, Y)
    inner = X.shape[1]
    bits = (DOUBLE_BITS - math.ceil(math.log2(max(inner, 1) * SLICES))) // 2
    first, second = _slices(X, bits), _slices(Y, bits)
    total = np.zeros((len(X), Y.shape[1]))
    rest, size = np.zeros_like(total), np.zeros_like(total)
    for count in range(1, SLICES + 1):  # the slices have `count + 1` times `bits` bits in all
        part = np.hstack(first[:count]) @ np.vstack(second[:count][::-1])
        both = total + part  # including the rounding of this sum (Knuth's TwoSum)
        back = both - total
        lost = (total - (both - back)) + (part - back)
        total, rest, size = both, rest + lost, size + np.abs(lost)
    mid = total + rest
    rad = EPS * np.abs(mid) + SLICES * EPS * size + SLICES * inner * 2.0 ** (-SLICES * bits)
    mid, rad = mid * scale, rad * scale * UPWARD
    return Enclosure(mid, rad + below * UPWARD)


def residual_product(X: RealArray, Y: RealArray) -> Enclosure:
    """As `sharp_product`, with 20 bits more than a product of doubles, by three products.

    The first slices are multiplied without rounding. All other terms are smaller by 2^-bits.
    """
    X, Y, scale, below = _in_units(X, Y)
    inner = X.shape[1]
    bits = (DOUBLE_BITS - math.ceil(math.log2(max(inner, 1)))) // 2
    X1, Y1 = (_slices(M, bits, 1)[0] for M in (X, Y))
    mid = X1 @ Y1 + (X1 @ (Y - Y1) + (X - X1) @ Y)
    rest = 2 * inner * 2.0**-bits  # bound of each entry of the last two products
    rad = EPS * np.abs(mid) + (inner + 4) * EPS * rest
    return Enclosure(mid * scale, rad * scale * UPWARD + below * UPWARD)


def _in_units(X: RealArray, Y: RealArray) -> tuple[RealArray, RealArray, RealArray, float]:
    """X (m, k) and Y (k, n) in units that are powers of two, with entries up to 1.

    Further results: the units (m, n) of their product, and the possible underflow in each entry of
    it.
    """
    # Small rows of Y are paired with large columns of X.
    beside = nearest_power_of_two(np.abs(Y).max(axis=1, initial=0.0))
    beside = np.clip(beside, 1 / LARGEST_WEIGHT, LARGEST_WEIGHT)
    X, Y = X * beside, Y / beside[:, None]
    below = 2 * X.shape[1] * TINY * (1 + np.abs(X).max(initial=0.0) + np.abs(Y).max(initial=0.0))
    rows, columns = (2 * nearest_power_of_two(np.abs(M).max(axis=1, initial=0.0)) for M in (X, Y.T))
    return X / rows[:, None], Y / columns, rows[:, None] * columns, below


def _slices(M: RealArray, bits: int, count: int = SLICES) -> list[RealArray]:
    """``count`` matrices of ``bits`` bits each that add up to the given one; the last one has all
    remaining bits.
    """
    found = []
    for k in range(1, count + 1):
        shift = 1.5 * 2.0 ** (52 - bits * k)
        found.append((M + shift) - shift)
        M = M - found[-1]
    return found


def enclosed_inverse(matrix: Enclosure) -> Enclosure | None:
    """Enclosure of the inverse of every enclosed matrix; None if one may be singular."""
    return solution(matrix, exact(np.eye(len(matrix.mid))))


def solution(matrix: Enclosure, right: Enclosure) -> Enclosure | None:
    """Enclosure of the X with A X = B for every enclosed A and B; None if A may be singular.

    For approximate Y of A^-1 and X, with E = 1 - Y A, the error of X is (1 - E)^-1 Y (B - A X). If
    |E| x <= theta x for some x > 0 and theta < 1, then (1 - |E|)^-1 Z <= Z + |E| x z / (1 - theta),
    z being the maximum of Z / x over each column of Z (Rump, Verification methods, Acta Numerica 19
    (2010) 287-449, section 10). The weights x help for matrices whose rows differ widely.
    """
    near, unit = in_its_unit(matrix.mid)
    try:
        Y = np.linalg.inv(near) / unit
    except np.linalg.LinAlgError:
        return None
    E = exact(np.eye(len(Y))) - exact(Y) @ matrix
    size = np.abs(E.mid) + E.rad
    X = Y @ right.mid
    X = X + Y @ (right.mid - matrix.mid @ X)
    rest = right - matrix @ exact(X)
    Z = np.abs(Y) @ (np.abs(rest.mid) + rest.rad) * UPWARD
    if not (np.isfinite(size).all() and np.isfinite(Z).all()):
        return None
    rad = amplified(size, Z)
    return None if rad is None else Enclosure(X, rad)


def amplified(size: RealArray, Z: RealArray) -> RealArray | None:
    """A bound (n, m) of (1 - |E|)^-1 Z for all |E| <= size (n, n) and Z (n, m) >= 0.

    It is the bound of `solution`. None if it is not proven that every 1 + E is regular.
    """
    x = np.ones(len(size))
    for _ in range(WEIGHTINGS):
        x = np.clip(size @ x / WANTED_CONTRACTION, 1.0, LARGEST_WEIGHT)
    moved = size @ x
    theta = float((moved / x).max(initial=0.0)) * UPWARD
    if not theta < 0.5:
        return None
    largest = (Z / x[:, None]).max(axis=0, initial=0.0)
    found: RealArray = (Z + moved[:, None] * largest / (1.0 - theta) * UPWARD) * UPWARD
    return found


def positive_definite(matrix: Enclosure) -> bool:
    """Whether every enclosed Hermitian matrix is proven to be positive definite.

    A congruence makes it nearly diagonal; all Gershgorin discs must lie right of 0. The
    transformation is regular then, too.
    """
    if not matrix.finite:
        return False
    diagonal = np.diagonal(matrix.mid).real
    if not (diagonal > 0).all():
        return False
    root = diagonal**-0.5
    X = np.linalg.eigh(root[:, None] * matrix.mid * root)[1] * root[:, None]
    product = exact(X.conj().T) @ (matrix @ exact(X))
    centre = np.diagonal(product.mid).real
    beside = np.abs(product.mid) + product.rad
    np.fill_diagonal(beside, np.diagonal(product.rad))
    return bool((centre > beside.sum(axis=1) * UPWARD).all())


def in_its_unit(matrix: Array) -> tuple[Array, float]:
    """A matrix in the unit of its largest entry, a power of two, and that unit.

    Eliminations and eigenvalue routines get matrices in this form: in some versions of LAPACK's
    kernels (OpenBLAS 0.3.27) an imaginary pivot beyond single precision makes NaN.
    """
    unit = float(nearest_power_of_two(np.abs(matrix).max(initial=0.0)))
    return matrix / unit, unit


def nearest_power_of_two(values: Any) -> Any:
    """The largest power of two not above each positive value; 1 for zero."""
    values = np.asarray(values, dtype=float)
    return np.where(values > 0, np.ldexp(1.0, np.frexp(values)[1] - 1), 1.0)
