"""The peak of a response over all frequencies, proven by polynomials on intervals that cover them.

A polynomial g of matrices that is near the response on an interval, |t| <= 1, proves by

    L^2 - g(t)^H g(t) > 0

that the response is below L plus the error of g. The interval is divided into parts, each around a
t_0. Three matrices prove the inequality on a part: the Bernstein coefficients of the expansion to
second order, minus a bound of the terms of higher order. If they are positive definite, so are
their convex combinations. The method needs no eigenvalues of a Hamiltonian matrix.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from workbench._core.arrays import EPS, Array, BoolArray, ComplexArray, RealArray
from workbench.certify.modes.partial_fractions import PartialFractions
from workbench.certify.modes.power_series import TERMS, Polynomials, polynomials
from workbench.certify.rounding import UPWARD

PARTS, LEVELS = 4, 6
"""Number of parts into which an interval, or a part that proves nothing, is divided, and how often.
The last parts are 4096 times as narrow as the interval. Half or double changes the time, and where
another proof takes over.
"""
MOST_PARTS = 200_000
"""The search stops at this number of parts of one level, since the bound is too close to the peak
for this proof; intervals then prove it. It limits memory. Half or double changes the time and which
proof is used.
"""
ENTRIES_AT_ONCE = 1_000_000
"""Number of entries of the parts' terms that are held in memory together. They take 16 MB. Half or
double changes memory and time only.
"""
Expansion = tuple[ComplexArray, ComplexArray, ComplexArray]
"""g_0, g_1 and g_2 of g_0 + g_1 u + g_2 u^2, each (S, q, p)."""


def proven_peak(fractions: PartialFractions, tolerance: float) -> float | None:
    """An upper bound of the largest singular value of a response over all frequencies.

    The bound is (1 + tolerance) times the largest value found; None if it is not proven.
    """
    found = polynomials(fractions)
    return None if found is None else _proven(found, tolerance)


def _proven(found: Polynomials, tolerance: float) -> float | None:
    """As `proven_peak`. A part that proves nothing is divided further; values there may raise the
    bound.
    """
    terms = found.terms
    terms = terms if terms.shape[2] >= terms.shape[3] else terms.conj().mT
    g = _Intervals(terms, found.error)
    cell, place = np.repeat(np.arange(len(terms)), PARTS), np.tile(np.arange(PARTS), len(terms))
    value = float(largest_singular_value(terms[:, 0]).max())
    step = max(ENTRIES_AT_ONCE // (terms[0].size), 1)
    for level in range(1, LEVELS + 1):
        open_ = np.ones(len(cell), bool)
        for start in range(0, len(cell), step):
            part = slice(start, start + step)
            expansion = g.expansion(cell[part], place[part], level)
            size = np.linalg.norm(expansion[0], axis=(1, 2))
            higher = largest_singular_value(expansion[0][size > value])
            value = max(value, float(higher.max(initial=0.0)))
            beta = (1.0 + tolerance) * value
            fails = ~g.holds(beta, expansion, cell[part], place[part], level)
            if (
                largest_singular_value(expansion[0][fails]) + g.error[cell[part][fails]] > beta
            ).any():
                return None  # no division would help
            open_[part] = fails
        if not open_.any():
            return beta
        cell, place = cell[open_], place[open_]
        if len(cell) * PARTS > MOST_PARTS:
            break
        cell = np.repeat(cell, PARTS)
        place = (place[:, None] * PARTS + np.arange(PARTS)).ravel()
    return None


class _Intervals:
    """Polynomials (F, TERMS + 1, q, p) on intervals, with p <= q, and their errors (F,)."""

    def __init__(self, terms: ComplexArray, error: RealArray) -> None:
        F, _, self.q, self.p = terms.shape
        self.terms = terms.reshape(F, TERMS + 1, -1)
        self.sizes = np.linalg.norm(self.terms, axis=2) * UPWARD
        self.total = self.sizes.sum(axis=1) * UPWARD
        self.error = (error + 8 * (TERMS + 20) * EPS * self.total) * UPWARD

    def expansion(self, cell: Array, place: Array, level: int) -> Expansion:
        """The polynomials expanded around the middles of parts: of intervals `cell`, at `place`
        (S,).
        """
        terms, (value, first, second, _) = self.terms[cell], _table(level)
        g0, g1, g2 = (
            np.einsum("sm,smx->sx", factors[place], terms).reshape(-1, self.q, self.p)
            for factors in (value, first, second)
        )
        return g0, g1, g2

    def holds(
        self, beta: float, expansion: Expansion, cell: Array, place: Array, level: int
    ) -> BoolArray:
        """Whether the response is proven to be below beta in each part (S,)."""
        half, total = float(PARTS) ** -level, self.total[cell]
        beyond = (self.sizes[cell] * _table(level)[3][place]).sum(axis=1) * half**3
        limit = (beta - (self.error[cell] + beyond) * UPWARD) / UPWARD
        first, second, third = (
            np.linalg.norm(part, axis=(1, 2)) * UPWARD * half**order
            for order, part in enumerate(expansion)
        )
        enough = limit > beta / 2  # also far above the loss of squares by underflow
        found: BoolArray = enough & (first + second + third < limit / UPWARD)
        tried = np.flatnonzero(enough & ~found)
        rounding = 32 * self.p * (self.p + self.q + 12) * EPS
        beside = (2 * second + third) * third + rounding * (limit**2 + total**2)
        square = limit**2 / UPWARD - beside * UPWARD
        g0, g1, g2 = (part[tried] for part in expansion)
        found[tried] = _is_below(square[tried], (g0, g1, g2), half)
        return found


@lru_cache(maxsize=LEVELS)
def _table(level: int) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """Factors (parts, TERMS + 1) that map the terms of a polynomial to its expansions around each
    part.

    The rows are the value, the first derivative, half the second derivative, and a bound of a sixth
    of the third derivative within the part.
    """
    count = PARTS**level
    t = ((2 * np.arange(count) + 1 - count) / count)[:, None]
    m = np.arange(TERMS + 1)
    farthest = (np.abs(t) + 1.0 / count) * UPWARD
    value, first, second, third = (
        np.array([math.comb(k, order) for k in m]) * base ** np.maximum(m - order, 0)
        for order, base in enumerate((t, t, t, farthest))
    )
    return value, first, second, third


def _is_below(square: RealArray, expansion: Expansion, half: float) -> BoolArray:
    """Whether |g_0 + g_1 u + g_2 u^2|^2, up to u^2, is below `square` (S,) for |u| <= half (S,)."""
    g0, g1, g2 = expansion

    def product(one: ComplexArray, two: ComplexArray) -> ComplexArray:
        found: ComplexArray = np.einsum("sqi,sqj->sij", one.conj(), two)
        return found

    slope, bend = product(g0, g1), product(g0, g2)
    slope = half * (slope + slope.conj().mT)
    bend = half**2 * (bend + bend.conj().mT + product(g1, g1))
    fixed = square[:, None, None] * np.eye(g0.shape[2]) - product(g0, g0)
    coefficients = fixed + bend, fixed - bend - slope, fixed - bend + slope
    found: BoolArray = np.all([_positive(one) for one in coefficients], axis=0)
    return found


def _positive(H: ComplexArray) -> BoolArray:
    """Whether elimination of Hermitian matrices (S, p, p) meets only positive pivots (S,).

    A matrix is then positive definite if a rounding of its trace is added to its diagonal (Rump,
    Verification of positive definiteness, BIT 46 (2006) 433-452).
    """
    found, rest = np.ones(len(H), bool), H.copy()
    for k in range(H.shape[1]):
        pivot = rest[:, k, k].real
        found &= pivot > 0.0
        below = rest[:, k + 1 :, k]
        factor = below / np.where(pivot > 0.0, pivot, 1.0)[:, None]
        rest[:, k + 1 :, k + 1 :] -= factor[:, :, None] * below.conj()[:, None, :]
    return found


def largest_singular_value(M: Array) -> RealArray:
    """The largest singular value of each matrix (F, c, r), (F,), up to rounding.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certify.modes.band_peak import largest_singular_value
    >>> largest_singular_value(np.diag([3.0, 4.0])[None]).tolist()
    [4.0]
    """
    c, r = M.shape[-2:]
    if min(c, r) == 0:
        return np.zeros(len(M))
    if min(c, r) > 2:
        return np.linalg.norm(M, 2, axis=(-2, -1))
    rows = M if c <= r else M.mT
    squares = (np.abs(rows) ** 2).sum(axis=-1)
    if len(squares.T) == 1:
        return np.sqrt(squares[:, 0])
    first, second = squares.T
    beside = np.abs((rows[:, 0] * rows[:, 1].conj()).sum(axis=-1))
    return np.sqrt((first + second) / 2 + np.hypot((first - second) / 2, beside))
