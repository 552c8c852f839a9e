"""Membership in cones and their duals, decided in exact rational arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from flint import arb, ctx, fmpq

from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.certify.rounding import BALL_BITS

Rational = Any
"""A `flint.fmpq`."""


def fraction(value: Rational) -> Fraction:
    """A rational number as Python's own."""
    return Fraction(int(value.p), int(value.q))


def in_cone(cone: ConeFactor, s: Sequence[Rational]) -> bool:
    """Whether rational numbers s lie in a cone."""
    if cone.kind is ConeKind.ZERO:
        return all(value == 0 for value in s)
    return _in_self_dual(cone, s, 1)


def in_dual_cone(cone: ConeFactor, y: Sequence[Rational]) -> bool:
    """Whether rational numbers y satisfy s'y >= 0 for every s of a cone."""
    # An entry off the diagonal stands for two entries of the symmetric matrix.
    return cone.kind is ConeKind.ZERO or _in_self_dual(cone, y, 2)


def outside(form: ConicForm, s: Sequence[Rational], *, dual: bool = False) -> int:
    """Number of cones (or of their duals) of a form that do not contain their part of s."""
    holds = in_dual_cone if dual else in_cone
    return sum(not holds(cone, s[rows]) for cone, rows in form.blocks)


def _in_self_dual(cone: ConeFactor, s: Sequence[Rational], share: int) -> bool:
    if cone.kind is ConeKind.NONNEGATIVE:
        return all(value >= 0 for value in s)
    if cone.kind is ConeKind.SECOND_ORDER:
        return bool(s[0] >= 0 and s[0] * s[0] >= sum((v * v for v in s[1:]), start=fmpq(0)))
    n = cone.size
    matrix = [[fmpq(0)] * n for _ in range(n)]
    for (i, j), value in zip(triangle(n), s, strict=True):
        matrix[i][j] = matrix[j][i] = value if i == j else value / share
    shown = _definite(matrix)
    return _is_semidefinite(matrix) if shown is None else shown


def _definite(M: list[list[Rational]]) -> bool | None:
    """Whether a symmetric rational matrix is positive definite (True) or has a negative eigenvalue
    (False).

    Decided in ball arithmetic, much faster than in rational numbers, whose digits grow with each
    step of the elimination. None if the balls do not decide.
    """
    n = len(M)
    with ctx.workprec(BALL_BITS):
        B = [[arb(value) for value in row] for row in M]
        for k in range(n):
            if B[k][k] < 0:  # after positive pivots only: Sylvester's law of inertia
                return False
            if not B[k][k] > 0:
                return None
            for i in range(k + 1, n):
                factor = B[k][i] / B[k][k]
                for j in range(i, n):
                    B[i][j] -= factor * B[k][j]
    return True


def _is_semidefinite(M: list[list[Rational]]) -> bool:
    """Whether a symmetric rational matrix has no negative eigenvalue; the matrix is overwritten.

    By elimination: each pivot must be positive, or zero with a row of zeros.
    """
    n = len(M)
    for k in range(n):
        pivot, row = M[k][k], M[k]
        if pivot < 0 or (pivot == 0 and any(row[j] != 0 for j in range(k + 1, n))):
            return False
        if pivot == 0:
            continue
        for i in range(k + 1, n):
            if row[i] == 0:
                continue
            factor = row[i] / pivot
            for j in range(i, n):
                M[i][j] = M[j][i] = M[i][j] - factor * row[j]
    return True
