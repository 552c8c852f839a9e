"""Random perturbations of a structure's unit ball, from a fixed seed."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.second_opinion import SEED
from workbench.structure import Complex, Full, Real, Structure


def vertex_perturbations(structure: Structure, count: int) -> ComplexArray:
    """Perturbations (count, rows, columns) with a largest singular value of at most 1.

    A complex scalar has modulus 1, and a full block has rank one and size 1, since the worst ones
    do (maximum modulus). A real scalar is 1 or -1, but in every third perturbation any number
    between.
    """
    rng = np.random.default_rng(SEED)
    found = np.zeros((count, structure.rows, structure.columns), dtype=complex)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            value = rng.choice([-1.0, 1.0], size=count)
            value[::3] = rng.uniform(-1.0, 1.0, size=len(value[::3]))
            found[:, row, column] = value[:, None, None] * np.eye(block.n)
        elif isinstance(block, Complex):
            turn = np.exp(2j * np.pi * rng.uniform(size=count))
            found[:, row, column] = turn[:, None, None] * np.eye(block.n)
        elif isinstance(block, Full):
            left, right = (_directions(rng, count, n) for n in (block.rows, block.columns))
            found[:, row, column] = left[:, :, None] * right[:, None, :].conj()
    return found


def constant_perturbations(structure: Structure, count: int) -> RealArray:
    """Real perturbations (count, rows, columns) of size 1: the same member at every frequency."""
    return np.array([_real(one, structure) for one in vertex_perturbations(structure, count)])


def turned_perturbations(structure: Structure, count: int, points: int) -> ComplexArray:
    """Closed curves (count, points, rows, columns) of perturbations of size at most 1.

    All blocks move at once: a complex block by its phase, once around or not at all; a real scalar
    from -1 to 1 and back, or not at all.
    """
    rng = np.random.default_rng(SEED)
    start = vertex_perturbations(structure, count)
    angle = np.linspace(0.0, 2 * np.pi, points, endpoint=False)
    found = np.zeros((count, points, structure.rows, structure.columns), dtype=complex)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        turns = rng.integers(-1, 2, size=(count, 1))
        phase = rng.uniform(0.0, 2 * np.pi, size=(count, 1))
        factor = np.exp(1j * turns * angle)
        if isinstance(block, Real):  # slightly beyond the ends, so that corners are reached
            moving = np.clip(np.sqrt(2.0) * np.cos(angle + phase), -1.0, 1.0)
            factor = np.where(turns == 0, 1.0, moving)
        found[:, :, row, column] = factor[..., None, None] * start[:, None, row, column]
    return found


def windings(M: Array, Delta: ComplexArray) -> RealArray:
    """Number of turns (k,) of det(I - M Delta) around 0 along curves (k, points, rows, columns).

    NaN if steps are too long to decide. From Delta_1 to Delta_2 the determinant is multiplied by
    det(I - X), X = (I - M Delta_1)^-1 M (Delta_2 - Delta_1): with all eigenvalues x of X smaller
    than 1 no perturbation between them makes it 0, and it turns by the sum of the angles of 1 - x.
    The curve can be contracted to Delta = 0 within a ball of perturbations. If the number of turns
    is not 0, some perturbation on the way makes I - M Delta singular (argument principle).
    """
    loops = np.eye(len(M)) - M @ Delta
    regular = (np.linalg.slogdet(loops)[0] != 0).all(axis=1)
    found: RealArray = np.full(len(Delta), np.nan)
    if regular.any():
        ahead = np.roll(Delta[regular], -1, axis=1) - Delta[regular]
        x = np.linalg.eigvals(np.linalg.solve(loops[regular], M @ ahead))
        turned = np.angle(1.0 - x).sum(axis=(1, 2)) / (2 * np.pi)
        told = (np.abs(x) < 1.0).all(axis=(1, 2))
        found[regular] = np.where(told, np.abs(np.rint(turned)), np.nan)
    return found


def loop_eigenvalues(M: ComplexArray, Delta: ComplexArray) -> Any:
    """Eigenvalues of M Delta, with M scaled by a power of two: some LAPACKs fail on entries of
    1e100.
    """
    _, exponent = np.frexp(np.abs(M).max(initial=0.0))
    size = 2.0 ** (int(exponent) - 1)
    found: Any = np.linalg.eigvals(M / size @ Delta) * size
    return found


def _real(Delta: ComplexArray, structure: Structure) -> RealArray:
    """A perturbation with real entries and blocks of size 1."""
    found = Delta.real.copy()
    for row, column in zip(structure.row_slices, structure.column_slices, strict=True):
        size = float(np.linalg.norm(found[row, column], 2))
        found[row, column] /= size or 1.0
    return found


def _directions(rng: np.random.Generator, count: int, n: int) -> ComplexArray:
    """Complex unit vectors (count, n)."""
    real, imag = rng.standard_normal((2, count, n))
    vectors = real + 1j * imag
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
