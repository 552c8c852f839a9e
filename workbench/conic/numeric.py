"""Approximate points of conic programs, by Clarabel. What they prove is decided elsewhere."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, hstack, vstack

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle

SCALING_ROUNDS = 10
"""Number of rounds of the scaling of rows and columns."""
SEARCH_TOLERANCE = 1e-9
"""Tolerance asked of the solver; a point well inside the cones needs no smaller one."""


def minimiser(form: ConicForm, seconds: float = math.inf) -> RealArray | None:
    """An approximate minimiser (n,) of a form; None if the solver returns none, whatever its
    status.

    The solver stops after ``seconds`` [s].
    """
    import clarabel

    rows, columns = scaling(form)
    A = diags_array(rows) @ form.A @ diags_array(columns)
    root = diags_array(_vectorised(form))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.time_limit = seconds
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        setattr(settings, name, SEARCH_TOLERANCE)
    n = form.c.size
    cost = form.c * columns
    size = np.abs(cost).max(initial=0.0) or 1.0
    unit = unit_of_points(form, rows)
    try:
        solver = clarabel.DefaultSolver(
            csc_array((n, n)),
            cost / size,
            csc_array(root @ A),
            root @ (rows * form.b / unit),
            [_native(cone) for cone in form.cones],
            settings,
        )
        solution = solver.solve()
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException:  # a Rust panic is no Exception
        return None
    x = unit * columns * np.array(solution.x)
    return x if np.isfinite(x).all() and "Infeasible" not in str(solution.status) else None


def inner_point(form: ConicForm, seconds: float = math.inf) -> RealArray | None:
    """A point (n,) whose slack b - A x lies as deep in the cones as it can, up to the size of b.

    Depth and size are measured in the scaled rows of the form. None if no point was found within
    ``seconds`` [s].
    """
    rows, _ = scaling(form)
    unit = units(form) / rows
    n = form.c.size
    A = vstack(
        [hstack([form.A, csr_array(unit[:, None])]), csr_array(([1.0], ([0], [n])), (1, n + 1))]
    )
    deeper = ConicForm(
        np.append(np.zeros(n), -1.0),
        A,
        np.append(form.b, unit_of_points(form, rows)),
        (*form.cones, ConeFactor(ConeKind.NONNEGATIVE, 1)),
    )
    found = minimiser(deeper, seconds)
    return None if found is None else found[:n]


def units(form: ConicForm) -> RealArray:
    """A point (m,) in the middle of every cone: ones, the axis, the unit matrix; 0 for zero
    cones.
    """
    parts = []
    for cone in form.cones:
        part = np.zeros(cone.rows)
        if cone.kind is ConeKind.NONNEGATIVE:
            part[:] = 1.0
        elif cone.kind is ConeKind.SECOND_ORDER:
            part[0] = 1.0
        elif cone.kind is ConeKind.SEMIDEFINITE:
            part[[i == j for i, j in triangle(cone.size)]] = 1.0
        parts.append(part)
    return np.concatenate([*parts, np.zeros(0)])


def unit_of_points(form: ConicForm, rows: RealArray) -> float:
    """A power of two near the size of b in scaled rows, 1 where b is 0."""
    size = float(np.abs(rows * form.b).max(initial=0.0)) or 1.0
    return float(2.0 ** np.round(np.log2(size)))


def scaling(form: ConicForm) -> tuple[RealArray, RealArray]:
    """Powers of two for the rows (m,) and columns (n,) that bring the entries of A near 1.

    The rows of a second-order or semidefinite cone share one factor, so that it remains the same
    cone.
    """
    rows, columns = np.ones(form.b.size), np.ones(form.c.size)
    size = abs(form.A)
    for _ in range(SCALING_ROUNDS):
        scaled = diags_array(rows) @ size @ diags_array(columns)
        rows /= np.sqrt(_shared(form, _largest(scaled, 1)))
        scaled = diags_array(rows) @ size @ diags_array(columns)
        columns /= np.sqrt(_largest(scaled, 0))
    return _power_of_two(rows), _power_of_two(columns)


def _largest(A: Any, axis: int) -> RealArray:
    """Largest entries of rows or columns; 1 where all entries are 0."""
    if 0 in A.shape:
        return np.ones(A.shape[1 - axis])
    found = np.asarray(A.max(axis=axis).todense(), dtype=float).ravel()
    return np.where(found > 0, found, 1.0)


def _shared(form: ConicForm, sizes: RealArray) -> RealArray:
    """Sizes of rows; rows of a cone that allows only a common factor all get the largest one."""
    sizes = sizes.copy()
    for cone, rows in form.blocks:
        if cone.kind in (ConeKind.SECOND_ORDER, ConeKind.SEMIDEFINITE):
            sizes[rows] = sizes[rows].max()
    return sizes


def _power_of_two(values: RealArray) -> RealArray:
    return np.asarray(2.0 ** np.round(np.log2(values)))


def _vectorised(form: ConicForm) -> RealArray:
    """Factors (m,) of the rows in the solver's own form of matrices: sqrt 2 off the diagonal."""
    factors = np.ones(form.b.size)
    for cone, rows in form.blocks:
        if cone.kind is ConeKind.SEMIDEFINITE:
            factors[rows] = [1.0 if i == j else np.sqrt(2.0) for i, j in triangle(cone.size)]
    return factors


def _native(cone: ConeFactor) -> Any:
    import clarabel

    return {
        ConeKind.ZERO: clarabel.ZeroConeT,
        ConeKind.NONNEGATIVE: clarabel.NonnegativeConeT,
        ConeKind.SECOND_ORDER: clarabel.SecondOrderConeT,
        ConeKind.SEMIDEFINITE: clarabel.PSDTriangleConeT,
    }[cone.kind](cone.size)
