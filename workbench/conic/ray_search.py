"""Searches for the rays that prove a conic program infeasible or unbounded.

Nothing here is trusted: `workbench.certify.cones` decides what a ray proves. Rays returned by
solvers are not used, so that the claims of all methods are judged in the same way, from the data
alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array, diags_array, eye_array, hstack, vstack

from workbench._core.arrays import EPS, RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.certify.cones.membership import Rational, fraction
from workbench.certify.cones.rays import excluded_radius
from workbench.certify.known_plants.exact_function import exact_rational
from workbench.conic.exact_points import exact_point
from workbench.conic.numeric import inner_point, minimiser
from workbench.executor import Context

INNER_SHARES = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
"""Shares of an inner point in a dual point, tried in turn until the dual point lies in its cone
exactly.
"""
SPOILT = 1e-9
"""Residual of a ray, relative to its terms, that rounding of the form may have caused."""
SEARCH = "search for a ray"
"""Name of the search in the message if the time limit ends it."""
ONE_ROW = ConeFactor(ConeKind.NONNEGATIVE, 1)


def dual_ray(form: ConicForm, context: Context) -> list[Rational] | None:
    """Rational y in the dual of K with b'y < 0 that excludes solutions up to a large radius.

    A'y = 0 exactly if such a y is found; otherwise sum |A'y| is as small as a solver makes it. None
    if no y excludes anything. Raises TimeLimitError.
    """
    rays = dual_rays(form)
    near = inner_point(rays, context.seconds_left(SEARCH))
    y = exact_point(rays, near) if near is not None else None
    if y is not None and excluded_radius(form, y) == math.inf:
        return y
    least = minimiser(_least_residual(form), context.seconds_left(SEARCH))
    if least is None:
        return None
    y = exact_point(rays, least[: form.b.size])
    if y is not None and excluded_radius(form, y) == math.inf:
        return y
    y = [exact_rational(value) for value in moved_into_dual(form, least[: form.b.size])]
    return y if excluded_radius(form, y) > 0.0 else None


def dual_point(form: ConicForm, *, share: float = 0.0) -> list[Rational] | None:
    """Rational y of the dual cone with A'y = -c and nearly the least b'y; None if none is found.

    It contains at least this share of an inner point, which is its distance from the cone's edge.
    """
    points = dual_points(form)
    best = minimiser(points)
    if best is None:
        return None
    if share == 0.0:
        if (y := exact_point(points, best)) is not None:
            return y
        for excess in INNER_SHARES:  # the deepest point with nearly the least b'y
            near = inner_point(_not_above(points, excess, best))
            if near is not None and (y := exact_point(points, near)) is not None:
                return y
    inner = inner_point(points)
    if inner is None:
        return None
    for part in (one for one in INNER_SHARES if one >= share):
        if (y := exact_point(points, (1 - part) * best + part * inner)) is not None:
            return y
    return None


def _not_above(points: ConicForm, excess: float, best: RealArray) -> ConicForm:
    """The points whose objective exceeds that of the best one by no more than this share of it."""
    terms = float(np.abs(points.c) @ np.abs(best))
    return ConicForm(
        points.c,
        vstack([points.A, csr_array(points.c[None, :])]),
        np.append(points.b, points.c @ best + excess * terms),
        (*points.cones, ONE_ROW),
    )


def settled_ray(form: ConicForm, y: Sequence[Rational]) -> Sequence[Rational]:
    """A y that excludes every solution: y is moved to where A'y = 0 if only rounding of the form
    prevents it.

    The doubles of a form that a Program computes differ in their last bits between processors, so
    that an exact ray gets a residual of rounding. A y with a larger residual is returned unchanged.
    """
    if excluded_radius(form, y) == math.inf:
        return y
    near = _doubles(y)
    residual, terms = np.abs(form.A.T @ near), abs(form.A).T @ np.abs(near)
    if not residual.sum() <= SPOILT * terms.sum():
        return y
    return exact_point(dual_rays(form), 2 * near) or y  # twice: away from the edge b'y = -1


def settled_point(form: ConicForm, y: Sequence[Rational]) -> Sequence[Rational]:
    """A y from `dual_point`, moved to where A'y = -c as in `settled_ray`."""
    return exact_point(dual_points(form), _doubles(y)) or y


def falling_ray(form: ConicForm, context: Context) -> list[Rational] | None:
    """Rational d with -A d in K and c'd <= -1; None if none was found. Raises TimeLimitError."""
    rays = ConicForm(
        form.c,
        vstack([form.A, csr_array(form.c[None, :])]),
        np.append(np.zeros(form.b.size), -1.0),
        (*form.cones, ONE_ROW),
    )
    return _exact_inner(rays, context)


def feasible_point(form: ConicForm, context: Context) -> list[Rational] | None:
    """Rational x with b - A x in K; None if none was found. Raises TimeLimitError."""
    return _exact_inner(form, context)


def dual_rays(form: ConicForm) -> ConicForm:
    """The y in the dual of K with A'y = 0 and b'y <= -1, as a conic form in y."""
    into, cones = _into_dual(form)
    return ConicForm(
        form.b,
        vstack([form.A.T, csr_array(form.b[None, :]), -into]),
        np.concatenate([np.zeros(form.c.size), [-1.0], np.zeros(into.shape[0])]),
        (*_cone(ConeKind.ZERO, form.c.size), ONE_ROW, *cones),
    )


def dual_points(form: ConicForm) -> ConicForm:
    """The y in the dual of K with A'y = -c, as a conic form in y whose objective is b'y."""
    into, cones = _into_dual(form)
    return ConicForm(
        form.b,
        vstack([form.A.T, -into]),
        np.concatenate([-form.c, np.zeros(into.shape[0])]),
        (*_cone(ConeKind.ZERO, form.c.size), *cones),
    )


def moved_into_dual(form: ConicForm, y: RealArray) -> RealArray:
    """Doubles y (m,); each part outside the dual of its cone is moved into it."""
    found = y.copy()
    for cone, rows in form.blocks:
        part = found[rows]
        if cone.kind is ConeKind.NONNEGATIVE:
            found[rows] = np.maximum(part, 0.0)
        elif cone.kind is ConeKind.SECOND_ORDER:
            length = float(np.linalg.norm(part[1:])) * (1 + 8 * part.size * EPS)
            found[rows.start] = max(part[0], length)
        elif cone.kind is ConeKind.SEMIDEFINITE:
            places = triangle(cone.size)
            Y = np.zeros((cone.size, cone.size))
            for (i, j), value in zip(places, part, strict=True):
                Y[i, j] = Y[j, i] = value if i == j else value / 2
            values = np.linalg.eigvalsh(Y)
            lack = max(-values[0], 0.0) + 64 * cone.size * EPS * np.abs(values).max()
            found[rows] = part + lack * np.array([i == j for i, j in places])
    return found


def _doubles(y: Sequence[Rational]) -> RealArray:
    return np.array([float(fraction(value)) for value in y])


def _exact_inner(form: ConicForm, context: Context) -> list[Rational] | None:
    near = inner_point(form, context.seconds_left(SEARCH))
    return None if near is None else exact_point(form, near)


def _least_residual(form: ConicForm) -> ConicForm:
    """Least sum |A'y| of a y in the dual of K with b'y <= -1, as a conic form in y and |A'y|."""
    n, m = form.c.size, form.b.size
    into, cones = _into_dual(form)
    one, none = eye_array(n), csr_array((into.shape[0], n))
    return ConicForm(
        np.concatenate([np.zeros(m), np.ones(n)]),
        vstack(
            [
                hstack([form.A.T, -one]),
                hstack([-form.A.T, -one]),
                hstack([csr_array(form.b[None, :]), csr_array((1, n))]),
                hstack([-into, none]),
            ]
        ),
        np.concatenate([np.zeros(2 * n), [-1.0], np.zeros(into.shape[0])]),
        (*_cone(ConeKind.NONNEGATIVE, 2 * n), ONE_ROW, *cones),
    )


def _cone(kind: ConeKind, size: int) -> tuple[ConeFactor, ...]:
    return (ConeFactor(kind, size),) if size else ()


def _into_dual(form: ConicForm) -> tuple[csr_array, tuple[ConeFactor, ...]]:
    """The map from y to points of cones that are their own duals, and these cones."""
    factors, kept = np.ones(form.b.size), np.ones(form.b.size, dtype=bool)
    for cone, rows in form.blocks:
        if cone.kind is ConeKind.ZERO:
            kept[rows] = False
        elif cone.kind is ConeKind.SEMIDEFINITE:  # y'S counts an off-diagonal entry twice
            factors[rows] = [1.0 if i == j else 0.5 for i, j in triangle(cone.size)]
    cones = tuple(cone for cone in form.cones if cone.kind is not ConeKind.ZERO)
    return csr_array(csr_array(diags_array(factors))[kept]), cones
