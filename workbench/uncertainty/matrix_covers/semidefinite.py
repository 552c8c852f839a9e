"""The semidefinite programs of rational weights: squares that are above given ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array, vstack

from workbench._core.arrays import Array, RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.conic.numeric import minimiser
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.uncertainty.matrix_covers.squares import ShapedSquare

Inequality = tuple[Array, Array]
"""Coefficients (f, unknowns, n, n) and constants (f, n, n) of Hermitian matrices that must be
positive semidefinite.
"""


def least(
    slope: RealArray,
    squares: Sequence[ShapedSquare],
    inequalities: Sequence[Inequality],
    context: Context,
) -> RealArray:
    """The unknowns of all squares, one after the other, that minimise slope' unknowns.

    Raises SolverError where the program has no answer.
    """
    rows, sides, cones = [], [], []
    place = 0
    for square in squares:
        for part in square.parts:  # Q >= 0
            count = len(part)
            unit = np.arange(count)
            rows.append(
                csr_array((-np.ones(count), (unit, place + unit)), shape=(count, slope.size))
            )
            sides.append(np.zeros(count))
            cones.append(ConeFactor(ConeKind.SEMIDEFINITE, part.order))
            place += count
    for coefficients, constant in inequalities:
        order = 2 * constant.shape[-1]
        i, j = np.array(triangle(order)).T
        left = np.moveaxis(_real(coefficients)[..., i, j], 1, 2)  # (f, rows, unknowns)
        rows.append(csr_array(-left.reshape(-1, slope.size)))
        sides.append(_real(constant)[..., i, j].ravel())
        cones += [ConeFactor(ConeKind.SEMIDEFINITE, order)] * len(constant)
    form = ConicForm(slope, vstack(rows), np.concatenate(sides), tuple(cones))
    found = minimiser(form, context.options.time_limit or np.inf)
    if found is None:
        raise SolverError(f"the semidefinite program of {slope.size} unknowns has no answer")
    return found


def _real(hermitian: Array) -> RealArray:
    """Hermitian matrices (..., n, n) as real symmetric ones of twice the size."""
    top = np.concatenate([hermitian.real, -hermitian.imag], axis=-1)
    bottom = np.concatenate([hermitian.imag, hermitian.real], axis=-1)
    return np.concatenate([top, bottom], axis=-2)
