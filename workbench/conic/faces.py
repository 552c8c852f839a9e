"""Linear equations that hold on the face of a cone near which a point lies.

An approximate point whose slack lies on the edge of a cone leaves the cone by rounding. If the
equations of the face are solved exactly, it stays inside.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, triangle

Combination = dict[int, Fraction]
"""Coefficients of slack rows whose combination is zero on the face."""

SIMPLE_DENOMINATOR = 1000
"""Directions of faces are rounded to fractions with denominators up to this, if these are close
enough.
"""


def face_equations(cone: ConeFactor, s: RealArray, cut: float) -> Iterator[Combination]:
    """Equations of the face of a cone near the point s; the cone is scaled so that s is near 1.

    Values smaller than ``cut`` count as zero.
    """
    if cone.kind is ConeKind.NONNEGATIVE:
        yield from ({i: Fraction(1)} for i in np.flatnonzero(s <= cut).tolist())
    elif cone.kind is ConeKind.SECOND_ORDER:
        yield from _second_order(s, cut)
    elif cone.kind is ConeKind.SEMIDEFINITE:
        yield from _semidefinite(cone.size, s, cut)


def _second_order(s: RealArray, cut: float) -> Iterator[Combination]:
    if s[0] <= cut:
        yield from ({i: Fraction(1)} for i in range(s.size))
    elif s[0] - np.linalg.norm(s[1:]) <= cut * s[0]:
        direction = rational_direction(s[1:], cut)
        yield from ({i: Fraction(1), 0: -q} for i, q in enumerate(direction, start=1))


def _semidefinite(n: int, s: RealArray, cut: float) -> Iterator[Combination]:
    """S u = 0 for a basis u of the space of small eigenvalues."""
    S, places = np.zeros((n, n)), {}
    for row, (i, j) in enumerate(triangle(n)):
        S[i, j] = S[j, i] = s[row]
        places[i, j] = places[j, i] = row
    values, vectors = np.linalg.eigh(S)
    small = vectors[:, values <= cut * max(values[-1], 1.0)]
    for u in _reduced_basis(small):
        simple = [_simple(value, np.sqrt(cut)) for value in u]
        for i in range(n):
            equation: Combination = {}
            for j, value in enumerate(simple):
                if value:
                    equation[places[i, j]] = equation.get(places[i, j], Fraction(0)) + value
            yield equation


def _reduced_basis(vectors: RealArray) -> RealArray:
    """A basis (k, n) of the space of columns (n, k) with a unit matrix at well-chosen places."""
    from scipy.linalg import qr

    if not vectors.shape[1]:
        return np.zeros((0, len(vectors)))
    order = qr(vectors.T, pivoting=True, mode="r")[1][: vectors.shape[1]]
    return np.asarray(np.linalg.solve(vectors[order].T, vectors.T))


def rational_direction(u: RealArray, cut: float) -> list[Fraction]:
    """A rational vector of length 1, exactly, near the direction of u (n,).

    Computed by the stereographic projection from a pole opposite to the largest entry, which is
    rational.
    """
    unit = u / np.linalg.norm(u)
    pole = int(np.argmax(np.abs(unit)))
    sign = 1 if unit[pole] > 0 else -1
    flat = np.delete(unit, pole) / (1 + abs(unit[pole]))
    w = [_simple(value, np.sqrt(cut)) for value in flat]
    square = sum((value * value for value in w), start=Fraction(0))
    found = [2 * value / (1 + square) for value in w]
    found.insert(pole, sign * (1 - square) / (1 + square))
    return found


def _simple(value: float, within: float) -> Fraction:
    """A simple fraction within a distance of a number, or the double itself if there is none."""
    own = Fraction(float(value))
    simple = own.limit_denominator(SIMPLE_DENOMINATOR)
    return simple if abs(simple - own) <= within else own
