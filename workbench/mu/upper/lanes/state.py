"""Data of eight central paths: points, steps, equations and scratch space, all in lanes.

Functions take these data by their addresses: an array would be seven numbers to pass, and passing
three dozen arrays takes longer to compile than the arithmetic. The caller owns the arrays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workbench._core.machine_code.addresses import addresses
from workbench._core.machine_code.sums import LANES, Lane


class Places(NamedTuple):
    """Places of the multipliers: D and G are diagonal, with one number for each block.

    Unlike a `Structure`, it has only arrays of indices, as compiled code reads them.

    ``left`` (c,) and ``right`` (r,) are the blocks of the rows and columns of M, ``blocks`` is
    their number. ``row`` and ``column`` (q,) are the channels of the real scalars.
    """

    left: Any
    right: Any
    row: Any
    column: Any
    blocks: int
    c: int
    r: int
    q: int


class Lanes(NamedTuple):
    """Eight points and the quantities computed from them; m is the number of unknowns (d, then g).

    Matrices (r, r): S, Z and their steps, L, S_inverse, V, Q, work. Matrices (c, r): M, MX, T_M and
    U_M. Matrices (c, c): T_C, U_C. Vectors of blocks: W, its step and the second orders of D and W.
    Vectors of unknowns: x and its step, u, b, toward_u, toward_b, pull, other, trial; H (m, m) with
    its pivots. Products P_R, P_C, P_M of entries; ``number`` has room for single numbers.
    """

    M: Lane
    S: Lane
    Z: Lane
    dS: Lane
    dZ: Lane
    L: Lane
    S_inverse: Lane
    V: Lane
    Q: Lane
    work: Lane
    MX: Lane
    T_M: Lane
    U_M: Lane
    T_C: Lane
    U_C: Lane
    P_R: Lane
    P_C: Lane
    P_M: Lane
    W: Lane
    dW: Lane
    second_D: Lane
    second_W: Lane
    x: Lane
    dx: Lane
    u: Lane
    b: Lane
    toward_u: Lane
    toward_b: Lane
    pull: Lane
    other: Lane
    trial: Lane
    H: Lane
    pivots: Lane
    number: Lane


SINGLE_NUMBERS = 16
"""Number of places in ``number``. Places 0 to 13 are used. With half of them memory beside it would
be overwritten; double changes nothing.
"""


class Numbers(NamedTuple):
    """One number for each lane: of the point, of the step, and of the search for its length.

    ``held`` is 1 where the last Cholesky factor existed and 0 elsewhere; ``none`` stays zero.
    """

    t: Lane
    gap: Lane
    nothing: Lane
    enough: Lane
    dt: Lane
    rho: Lane
    along: Lane
    bb: Lane
    schur: Lane
    center: Lane
    primal: Lane
    dual: Lane
    ahead: Lane
    step: Lane
    high: Lane
    held: Lane
    none: Lane


class Fates(NamedTuple):
    """Status of the path in each lane, 0 or 1; ``matrix`` is the index of its matrix.

    ``used`` counts the iterations.
    """

    active: Lane
    lost: Lane
    matrix: Lane
    used: Lane


lanes_at: Any = addresses(Lanes)
numbers_at: Any = addresses(Numbers)
fates_at: Any = addresses(Fates)


class Room(NamedTuple):
    """Zero arrays for eight paths, and the places where the parts of `Lanes` and of the other
    records start.
    """

    lanes: np.ndarray
    numbers: np.ndarray
    fates: np.ndarray
    starts: np.ndarray
    rows: np.ndarray


def room_for(c: int, r: int, blocks: int, q: int) -> Room:
    """Room for eight paths of matrices (c, r), with ``q`` real scalars among the ``blocks``."""
    m = blocks + q
    entries = (
        (2 * c * r, "M MX T_M U_M"),
        (2 * r * r, "S Z dS dZ L S_inverse V Q work"),
        (2 * c * c, "T_C U_C"),
        (r * r, "P_R"),
        (c * c, "P_C"),
        (c * r, "P_M"),
        (blocks, "W dW second_D second_W"),
        (m, "x dx u b toward_u toward_b pull other trial pivots"),
        (m * m, "H"),
        (SINGLE_NUMBERS, "number"),
    )
    sizes = {name: LANES * size for size, names in entries for name in names.split()}
    ends = np.cumsum([sizes[name] for name in Lanes._fields])
    numbers, fates = len(Numbers._fields), len(Fates._fields)
    return Room(
        np.zeros(ends[-1]),
        np.zeros(numbers * LANES),
        np.zeros(fates * LANES, np.int64),
        np.concatenate([[0], ends[:-1]]),
        np.arange(max(numbers, fates)) * LANES,
    )
