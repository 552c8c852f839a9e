"""Exact rational points of conic programs, from approximate ones."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConeKind, ConicForm
from workbench.certify.cones.membership import Rational, outside
from workbench.certify.cones.rays import conic_slack
from workbench.certify.known_plants.exact_function import exact_rational
from workbench.conic.faces import Combination, face_equations
from workbench.conic.numeric import scaling

CUTS = (0.0, 1e-8, 1e-6, 1e-4, 1e-3)
"""Shares of the size of a point below which it counts as on the edge of a cone, tried in turn."""
MOST_ENTRIES = 30_000
"""Largest number of entries of equations that are eliminated exactly, which takes about half a
minute.
"""
MOST_EQUATIONS = 400
"""Largest number of independent equations that are solved exactly by lifting, which takes a few
seconds.
"""
DEPENDENT = 1e-10
"""Equations may depend on each other if a pivot, relative to the largest one, is below this."""


def exact_point(form: ConicForm, near: RealArray) -> list[Rational] | None:
    """Rational x near given doubles with b - A x in K exactly; None if none was found.

    Programs with more equations than exact arithmetic can solve in about half a minute are not
    tried.
    """
    tried: set[int] = set()
    count = sum(cone.size for cone, _ in form.blocks if cone.kind is ConeKind.ZERO)
    for cut in CUTS:
        if _too_many(count, near.size):
            return None
        equations = _equations(form, near, cut)
        count = len(equations)
        if count in tried:  # larger cuts only add equations
            continue
        tried.add(count)
        x = _solved(equations, near)
        if x is not None and not outside(form, conic_slack(form, x)):
            return x
    return None


def _equations(form: ConicForm, near: RealArray, cut: float) -> list[Combination]:
    """Equations in x, with their right-hand sides in the last column: from zero cones and nearby
    faces.
    """
    rows, _ = scaling(form)
    s = form.b - form.A @ near
    found: list[Combination] = []
    for cone, part in form.blocks:
        combinations: Sequence[Combination]
        if cone.kind is ConeKind.ZERO:
            combinations = [{i: Fraction(1)} for i in range(cone.size)]
        else:
            scaled = rows[part] * s[part]
            size = max(float(np.abs(rows * s).max(initial=0.0)), 1e-300)
            # All rows of a cone share one factor, so that equations between them remain valid.
            combinations = list(face_equations(cone, scaled / size, cut)) if cut else []
        found += [_in_x(form, part.start, one) for one in combinations]
    return found


def _in_x(form: ConicForm, start: int, combination: Combination) -> Combination:
    """The equation in x that a combination of slack rows is zero."""
    A, n = form.A, form.c.size
    found: Combination = {n: Fraction(0)}
    for row, factor in combination.items():
        i = start + row
        found[n] += factor * Fraction(float(form.b[i]))
        for k in range(A.indptr[i], A.indptr[i + 1]):
            j = int(A.indices[k])
            found[j] = found.get(j, Fraction(0)) + factor * Fraction(float(A.data[k]))
    return found


def _solved(equations: Sequence[Combination], near: RealArray) -> list[Rational] | None:
    """The rational solution that agrees with given doubles as far as the equations leave a choice.

    None if the equations contradict each other.
    """
    n = near.size
    x: list[Any] = [exact_rational(value) for value in near]
    if not equations:
        return x
    if n == 0:
        return None if any(equation[n] != 0 for equation in equations) else x
    if _too_many(len(equations), n):
        return None
    order, independent = _pivot_order(equations, near)
    if independent and len(equations) <= MOST_EQUATIONS:
        return _lifted(equations, x, order)
    if len(equations) * (n + 1) > MOST_ENTRIES:  # dependent equations are left to the elimination
        return None
    place = {column: k for k, column in enumerate(order)} | {n: n}
    table = fmpq_mat(len(equations), n + 1)
    for i, equation in enumerate(equations):
        for column, value in equation.items():
            table[i, place[column]] = fmpq(value.numerator, value.denominator)
    reduced, rank = table.rref()
    pivots = []
    for i in range(rank):
        pivot = next(k for k in range(n + 1) if reduced[i, k] != 0)
        if pivot == n:
            return None
        pivots.append(pivot)
    free = sorted(set(range(n)) - set(pivots))
    for i, pivot in enumerate(pivots):
        x[order[pivot]] = reduced[i, n] - sum(
            (reduced[i, k] * x[order[k]] for k in free if k > pivot and reduced[i, k] != 0),
            start=fmpq(0),
        )
    return x


def _too_many(equations: int, unknowns: int) -> bool:
    """Whether the equations are too many for lifting and for elimination."""
    return equations > MOST_EQUATIONS and equations * (unknowns + 1) > MOST_ENTRIES


def _lifted(
    equations: Sequence[Combination], x: list[Rational], order: Sequence[int]
) -> list[Rational] | None:
    """x with its first entries, by order, changed so that independent equations hold.

    FLINT lifts large systems p-adically (Dixon), so that numbers stay small that would grow in an
    elimination. None if the columns of these entries are singular although doubles say that they
    are not.
    """
    n, r = len(x), len(equations)
    place = {column: k for k, column in enumerate(order[:r])}
    table, right = fmpq_mat(r, r), fmpq_mat(r, 1)
    for i, equation in enumerate(equations):
        rest = fmpq(0)
        for column, value in equation.items():
            exact = fmpq(value.numerator, value.denominator)
            if column in place:
                table[i, place[column]] = exact
            else:
                rest += exact if column == n else -exact * x[column]
        right[i, 0] = rest
    try:
        found = table.solve(right)
    except ZeroDivisionError:
        return None
    moved = list(x)
    for column, k in place.items():
        moved[column] = found[k, 0]
    return moved


def _pivot_order(equations: Sequence[Combination], near: RealArray) -> tuple[list[int], bool]:
    """The columns, with well-conditioned pivots first, so that the equations move them little.

    The second result says whether the equations are independent, by a wide margin.
    """
    from scipy.linalg import qr

    n = near.size
    table = np.zeros((len(equations), n))
    for i, equation in enumerate(equations):
        for column, value in equation.items():
            if column < n:
                table[i, column] = float(value)
    size = np.abs(table).max(axis=1, keepdims=True)
    table /= np.where(size > 0, size, 1.0)
    weight = np.abs(near)
    weight = np.maximum(weight, 1e-9 * (weight.max(initial=0.0) or 1.0))
    upper, order = qr(table * weight, pivoting=True, mode="r")
    pivots = np.abs(np.diag(upper))
    full = pivots.size == len(equations) and bool(pivots[-1] > DEPENDENT * pivots[0])
    return [int(k) for k in order], full
