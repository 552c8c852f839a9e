"""Perturbations of a structure's unit ball, drawn from a fixed seed."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.second_opinion import SEED
from workbench.structure import Complex, Full, Real, Structure


def vertex_perturbations(structure: Structure, count: int) -> ComplexArray:
    """Perturbations (count, rows, columns) of largest singular value 1 at most.

    A complex scalar has modulus 1 and a full block is of rank one and size 1, since the worst ones
    are (maximum modulus). A real scalar is 1 or -1, and in every third perturbation any between.
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
    """Real perturbations (count, rows, columns) of size 1: they are members at every frequency."""
    return np.array([_real(one, structure) for one in vertex_perturbations(structure, count)])


def loop_eigenvalues(M: ComplexArray, Delta: ComplexArray) -> Any:
    """Eigenvalues of M Delta, M scaled by a power of two: some LAPACKs fail on entries of 1e100."""
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
