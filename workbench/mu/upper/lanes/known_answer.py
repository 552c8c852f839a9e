"""The self-test of the paths in lanes: matrices of rank one, whose mu is known."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.machine_code.sums import LANES
from workbench.certify.mu_bound import said_bound
from workbench.mu.upper.lanes.path import follow_paths
from workbench.mu.upper.lanes.state import room_for
from workbench.mu.upper.pattern import diagonal_places, expanded_multipliers, pattern_of
from workbench.structure import Complex, Full, Real, Structure

STRUCTURE = Structure([Real(1), Real(1), Complex(1), Full(1, 2)])
ACCURACY = 1e-6
"""Relative gap at which the paths end. Bounds are then better than `AGREEMENT` asks. Half or
double: an iteration more or less.
"""
AGREEMENT = 1e-5
"""Largest relative distance of a bound from mu; it also holds the rounding outward. A wrong
instruction gives errors of order 1. Half or double decides the same.
"""


def check_lanes() -> None:
    """Raise ArithmeticError unless the bounds for M = u v^T equal mu.

    For u and v > 0, mu is the sum over the blocks of |part of u| |part of v|. It is reached with
    real scalars of 1, so they count like complex ones. In every second matrix only the two real
    scalars count, with u_i v_i = 1 + j and 1 - j. Their imaginary parts must cancel, so mu is 2.
    This bound needs G: D alone proves 2 sqrt(2).
    """
    count = LANES + 3
    u, v = np.split(np.random.default_rng(0).uniform(0.5, 2.0, (count, 9)), [5], axis=1)
    sizes = np.column_stack([u[:, :3], np.linalg.norm(u[:, 3:], axis=1)])
    v[1::2, 2:] = 0.0
    mu = (sizes * v).sum(axis=1)
    mu[1::2] = 2.0
    columns: ComplexArray = u.astype(complex)
    columns[1::2, :2] = np.array([1 + 1j, 1 - 1j]) / v[1::2, :2]
    found = _bounds(columns[:, :, None] * v[:, None, :].astype(complex))
    apart = np.abs(found / mu - 1).max()
    if not apart <= AGREEMENT:
        raise ArithmeticError(f"a bound of mu is a factor 1 + {apart:.2g} from the known one")


def _bounds(M: ComplexArray) -> RealArray:
    """Upper bounds of mu of matrices M (F, 5, 4)."""
    pattern, count = pattern_of(STRUCTURE), len(M)
    places, real = diagonal_places(pattern), pattern.row[pattern.skew]
    d, g = np.empty((count, pattern.size)), np.empty((count, real.size))
    gaps, iterations, least = np.full(count, np.inf), np.zeros(count, int), np.zeros(count)
    room = room_for(M.shape[1], M.shape[2], pattern.size, real.size)
    with np.errstate(all="ignore"):  # as for any matrix
        follow_paths(M, places, room, ACCURACY, least, d, g, gaps, iterations)
    D, G = np.zeros((2, count, pattern.size, pattern.size), complex)
    every = np.arange(pattern.size)
    D[:, every, every], G[:, real, real] = d, g
    return said_bound(M, STRUCTURE, *expanded_multipliers(pattern, D, G))
