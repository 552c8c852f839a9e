"""A minimal realisation of the part with poles on the boundary of stability, in exact fractions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq_mat

from workbench._core.heavy_types import StateSpace
from workbench.certify.realisations.parts import (
    boundary_projector,
    in_fractions,
    nearest_doubles,
    states_of,
)
from workbench.systems.realisation import Matrices, matrices_of


def least_boundary_part(system: StateSpace) -> Matrices:
    """A, B, C and D = 0 of the exact part on the boundary, with the fewest states, rounded to
    doubles.

    The matrix H of its Markov parameters is the product of the rows C A^i and the columns A^j B.
    Rows and columns that determine the rank of H give a basis (B. L. Ho, R. E. Kalman, Effective
    construction of linear state-variable models from input/output functions, Regelungstechnik 14
    (1966) 545-548).
    """
    A, B, C, D = matrices_of(system)
    projector = boundary_projector(A, bool(system.dt))
    nothing = np.zeros((0, 0)), np.zeros((0, B.shape[1])), np.zeros((len(C), 0)), 0.0 * D
    if projector is None:
        return nothing
    k, a = states_of(projector), in_fractions(A)
    own, seen = [projector * in_fractions(B)], [in_fractions(C) * projector]
    for _ in range(k - 1):
        own.append(a * own[-1])
        seen.append(seen[-1] * a)
    reached = _side_by_side(own)
    shown = _side_by_side([part.transpose() for part in seen]).transpose()
    H = shown * reached
    columns, rows = _pivots(H), _pivots(H.transpose())
    if not rows:
        return nothing
    R, shown = _picked(reached.transpose(), columns).transpose(), _picked(shown, rows)
    inner = shown * R
    parts = inner.solve(shown * a * R), inner.solve(shown * own[0]), seen[0] * R
    A, B, C = (nearest_doubles(part) for part in parts)
    return A, B, C, 0.0 * D


def _side_by_side(parts: Sequence[fmpq_mat]) -> fmpq_mat:
    """Matrices side by side."""
    rows = [part.tolist() for part in parts]
    return fmpq_mat([[x for part in rows for x in part[i]] for i in range(parts[0].nrows())])


def _picked(matrix: fmpq_mat, rows: Sequence[int]) -> fmpq_mat:
    every = matrix.tolist()
    return fmpq_mat([every[i] for i in rows])


def _pivots(matrix: fmpq_mat) -> list[int]:
    """Indices of the first independent columns of a matrix, which are a basis of its range."""
    reduced, rank = matrix.rref()
    width = reduced.ncols()
    return [next(j for j in range(width) if reduced[i, j] != 0) for i in range(rank)]
