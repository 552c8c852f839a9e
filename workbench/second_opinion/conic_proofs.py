"""Proofs of conic programs, checked in plain fractions and on random members of the cones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certificate import Check
from workbench.executor.effort import tries
from workbench.second_opinion import SEED

MEMBERS = 20
"""Number of random members of the product of cones."""
SAMPLED_ROUNDING = 1e-9
"""Largest amount by which a product in doubles may be below 0, or a slack outside its cone, as a
share of the terms.
"""
ROWS_ALONE = ("ZERO", "NONNEGATIVE")
"""Cones in which each row is judged relative to its own size."""
STEPS = (1.0, 1e3, 1e6)
"""Steps along a ray."""


def supports(form: Any, y: Sequence[Any]) -> Check:
    """Check that no random member of the cones has a negative product with y."""
    values = np.array([float(Fraction(str(value))) for value in y])
    rng, worst = np.random.default_rng(SEED), 0.0
    for _ in range(tries(MEMBERS)):
        for cone, rows in form.blocks:
            terms = values[rows] * _member(cone, rng)
            size = float(np.abs(terms).sum())
            worst = max(worst, -float(terms.sum()) / size if size > 0 else 0.0)
    statement = "most that a product of y and a member is below 0, relative to its terms"
    over = f"for {tries(MEMBERS)} members of each cone"
    return Check("drawn members", statement, worst, SAMPLED_ROUNDING, over=over)


def separates(form: Any, y: Sequence[Any], radius: float) -> Check:
    """Check that y'(b - A x) < 0 for every x with max |x| < R, in fractions."""
    exact = [Fraction(str(value)) for value in y]
    level = sum((Fraction(b) * v for b, v in zip(form.b.tolist(), exact, strict=True)), Fraction(0))
    reach = sum((abs(value) for value in _columns(form, exact)), Fraction(0))
    most = -level / reach if reach else math.inf if level < 0 else 0.0
    beyond = 0.0 if radius <= most else (float(radius / float(most)) - 1.0 if most else math.inf)
    statement = "claimed R over -b'y / sum |A'y| in fractions, less 1"
    return Check("separation in fractions", statement, beyond, SAMPLED_ROUNDING)


def duality(form: Any, x: RealArray, y: Sequence[Any], gap: float) -> list[Check]:
    """Checks that A'y = -c and that the gap is y'(b - A x), in fractions (weak duality)."""
    exact = [Fraction(str(value)) for value in y]
    rows = [Fraction(b) for b in form.b.tolist()]
    for i, j, value in _entries(form):
        rows[i] -= value * Fraction(float(x[j]))
    product = sum((v * s for v, s in zip(exact, rows, strict=True)), Fraction(0))
    apart = abs(float(product) - gap) / (1.0 + abs(gap) + abs(float(form.c @ x)))
    return [
        dual_equations(form, y),
        Check(
            "weak duality",
            "difference of the gap from y'(b - A x) in fractions, relative to 1 + |value|",
            apart,
            SAMPLED_ROUNDING,
        ),
    ]


def dual_equations(form: Any, y: Sequence[Any]) -> Check:
    """Check that A'y = -c in fractions."""
    columns = _columns(form, [Fraction(str(value)) for value in y])
    off = sum(a + Fraction(c) != 0 for a, c in zip(columns, form.c.tolist(), strict=True))
    return Check("A'y in fractions", "entries of A'y + c that are not 0", float(off), 0.0)


def inside(form: Any, x: RealArray, claimed: float) -> Check:
    """Check that b - A x, in fractions, leaves the cones by no more than claimed.

    Products of b - A x with members of the dual cones must be nonnegative, up to the claim; the
    dual cones are the cones themselves, except for equations. The claim is relative to 1 + |b| +
    |A| |x| of the rows, or of the largest row of a cone. The first member tried is the worst one,
    and the others are random.
    """
    rng, worst = np.random.default_rng(SEED), 0.0
    exact = [Fraction(b) for b in form.b.tolist()]
    size = [1 + abs(b) for b in exact]
    for i, j, value in _entries(form):
        term = value * Fraction(float(x[j]))
        exact[i], size[i] = exact[i] - term, size[i] + abs(term)
    slack = np.array([float(value) for value in exact])
    sizes = np.array([float(value) for value in size])
    for number in range(tries(MEMBERS)):
        for cone, rows in form.blocks:
            if cone.kind.name == "ZERO":
                member = rng.choice([-1.0, 1.0], size=cone.rows)
            else:
                own = _member(cone, rng) if number else _worst_member(cone, slack[rows])
                member = _with_doubled_off_diagonal(cone, own)
            allowed = sizes[rows] if cone.kind.name in ROWS_ALONE else sizes[rows].max()
            weight = float(np.sum(np.abs(_weight(cone, member)) * allowed))
            if weight > 0:
                worst = max(worst, -float(member @ slack[rows]) / weight - max(claimed, 0.0))
    statement = "most that a product of b - A x and a member is below the claim, relative"
    over = f"for {tries(MEMBERS)} members of each dual cone"
    return Check("slack in fractions", statement, worst, SAMPLED_ROUNDING, over=over)


def _worst_member(cone: Any, s: RealArray) -> RealArray:
    """The member of a cone, of a size like that of s, whose product with s is least."""
    if cone.kind.name == "NONNEGATIVE":
        return np.asarray(s < 0.0, dtype=float)
    if cone.kind.name == "SECOND_ORDER":
        return np.concatenate([[np.linalg.norm(s[1:])], -s[1:]])
    v = np.linalg.eigh(_matrix(cone, s))[1][:, 0]
    return np.array([v[i] * v[j] for i, j in _triangle(cone.size)])


def _with_doubled_off_diagonal(cone: Any, member: RealArray) -> RealArray:
    """A member with its off-diagonal entries doubled, as products of matrices count them twice."""
    if cone.kind.name != "SEMIDEFINITE":
        return member
    return member * np.array([1.0 if i == j else 2.0 for i, j in _triangle(cone.size)])


def _weight(cone: Any, member: RealArray) -> RealArray:
    """Amount by which a product with a member may be below 0, per unit by which the slack is
    outside.
    """
    if cone.kind.name == "SECOND_ORDER":
        return member[:1]
    if cone.kind.name == "SEMIDEFINITE":
        diagonal = [k for k, (i, j) in enumerate(_triangle(cone.size)) if i == j]
        return np.array([member[diagonal].sum()])
    return member


def falls(form: Any, x: Sequence[Any], ray: Sequence[Any]) -> Check:
    """Check that points along a ray stay in the cones and that the objective decreases there."""
    start, way = (np.array([float(Fraction(str(v))) for v in one]) for one in (x, ray))
    worst = float(form.c @ way >= 0)
    for step in STEPS:
        point = start + step * way
        slack, size = form.b - form.A @ point, np.abs(form.b) + abs(form.A) @ np.abs(point)
        for cone, rows in form.blocks:
            worst = max(
                worst, _distance_outside(cone, slack[rows]) / max(float(size[rows].max()), 1.0)
            )
    statement = "most that a point along the ray lies outside of a cone, relative; 1: nothing falls"
    return Check("along the ray", statement, worst, SAMPLED_ROUNDING, over=f"at {STEPS}")


def _entries(form: Any) -> list[tuple[int, int, Fraction]]:
    """Row and column indices and values of the nonzero entries of A."""
    A = form.A.tocoo()
    places = zip(A.row.tolist(), A.col.tolist(), A.data.tolist(), strict=True)
    return [(i, j, Fraction(value)) for i, j, value in places]


def _columns(form: Any, y: list[Fraction]) -> list[Fraction]:
    """A'y."""
    found = [Fraction(0)] * form.c.size
    for i, j, value in _entries(form):
        found[j] += value * y[i]
    return found


def _member(cone: Any, rng: np.random.Generator) -> RealArray:
    """A random member on the border of a cone: its rows of b - A x."""
    kind, count = cone.kind.name, cone.rows
    if kind == "ZERO":
        return np.zeros(count)
    if kind == "NONNEGATIVE":
        return np.abs(rng.standard_normal(count)) * (rng.uniform(size=count) < 0.5)
    if kind == "SECOND_ORDER":
        v = rng.standard_normal(count - 1)
        return np.concatenate([[np.linalg.norm(v)], v])
    v = rng.standard_normal(cone.size)
    return np.array([v[i] * v[j] for i, j in _triangle(cone.size)])


def _distance_outside(cone: Any, s: RealArray) -> float:
    """Distance of s from a cone; 0 inside."""
    kind = cone.kind.name
    if kind == "ZERO":
        return float(np.abs(s).max(initial=0.0))
    if kind == "NONNEGATIVE":
        return float(-s.min(initial=0.0))
    if kind == "SECOND_ORDER":
        return float(np.linalg.norm(s[1:]) - s[0])
    return float(-np.linalg.eigvalsh(_matrix(cone, s))[0])


def _matrix(cone: Any, s: RealArray) -> RealArray:
    """The symmetric matrix whose triangle is s."""
    S = np.zeros((cone.size, cone.size))
    for (i, j), value in zip(_triangle(cone.size), s, strict=True):
        S[i, j] = S[j, i] = value
    return S


def _triangle(order: int) -> list[tuple[int, int]]:
    """Rows and columns of the upper triangle, column by column."""
    return [(i, j) for j in range(order) for i in range(j + 1)]
