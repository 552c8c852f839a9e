"""Data of eight central paths: points, steps, equations, scratch arrays, all of lanes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper.lanes.simd import LANES


class Places(NamedTuple):
    """Where the multipliers stand: D and G are diagonal, with one number for each block.

    ``left`` (c,) and ``right`` (r,) are the blocks of the rows and columns of M, ``blocks`` is
    their number. ``row`` and ``column`` (q,) are the channels of the real scalars.
    """

    left: np.ndarray
    right: np.ndarray
    row: np.ndarray
    column: np.ndarray
    blocks: int


class Lanes(NamedTuple):
    """Eight points and what is computed from them; m is the number of unknowns (d, then g).

    Matrices (r, r): S, Z and their steps, L, S_inverse, V, Q, work. Matrices (c, r): M, MX, T_M and
    U_M. Matrices (c, c): T_C, U_C. Vectors of blocks: W, its step and the second order of that. Of
    unknowns: x and its step, u, b, toward_u, toward_b, pull, other, trial; H (m, m) with its
    pivots. Products P_R, P_C, P_M of entries; ``number`` has room for single numbers.
    """

    M: np.ndarray
    S: np.ndarray
    Z: np.ndarray
    dS: np.ndarray
    dZ: np.ndarray
    L: np.ndarray
    S_inverse: np.ndarray
    V: np.ndarray
    Q: np.ndarray
    work: np.ndarray
    MX: np.ndarray
    T_M: np.ndarray
    U_M: np.ndarray
    T_C: np.ndarray
    U_C: np.ndarray
    P_R: np.ndarray
    P_C: np.ndarray
    P_M: np.ndarray
    W: np.ndarray
    dW: np.ndarray
    second: np.ndarray
    x: np.ndarray
    dx: np.ndarray
    u: np.ndarray
    b: np.ndarray
    toward_u: np.ndarray
    toward_b: np.ndarray
    pull: np.ndarray
    other: np.ndarray
    trial: np.ndarray
    H: np.ndarray
    pivots: np.ndarray
    number: np.ndarray


@compiled
def room_for(places: Places) -> Lanes:
    """Zeros for eight paths."""
    c, r, N = places.left.size, places.right.size, places.blocks
    m = N + places.row.size
    two = 2 * LANES
    return Lanes(
        np.zeros(c * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(r * r * two),
        np.zeros(c * r * two),
        np.zeros(c * r * two),
        np.zeros(c * r * two),
        np.zeros(c * c * two),
        np.zeros(c * c * two),
        np.zeros(r * r * LANES),
        np.zeros(c * c * LANES),
        np.zeros(c * r * LANES),
        np.zeros(N * LANES),
        np.zeros(N * LANES),
        np.zeros(N * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * LANES),
        np.zeros(m * m * LANES),
        np.zeros(m * LANES),
        np.zeros(16 * LANES),
    )


class Numbers(NamedTuple):
    """One number for each lane (LANES,): of the point, of the step, and what becomes of its path.

    ``none`` stays zero; ``matrix`` is the number of the matrix, ``used`` counts its iterations.
    """

    t: np.ndarray
    nothing: np.ndarray
    enough: np.ndarray
    dt: np.ndarray
    rho: np.ndarray
    along: np.ndarray
    bb: np.ndarray
    schur: np.ndarray
    center: np.ndarray
    primal: np.ndarray
    dual: np.ndarray
    ahead: np.ndarray
    none: np.ndarray
    held: np.ndarray
    active: np.ndarray
    lost: np.ndarray
    matrix: np.ndarray
    used: np.ndarray


@compiled
def numbers() -> Numbers:
    """Zeros for eight lanes, none of which has a matrix."""
    return Numbers(
        np.ones(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES),
        np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.bool_),
        np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64),
    )
