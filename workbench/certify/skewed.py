"""Proven lower bounds of the skewed mu: fixed blocks of size at most 1, bounded varying blocks.

Let exactly known fixed blocks Delta_f, of norm at most 1, close their part of the loop. The varying
blocks then act on N = (I - M Delta_f)^-1 M, and a lower bound of mu of N for these blocks is a
lower bound of the skewed mu. If that proves nothing, all blocks are varied together.
"""

from __future__ import annotations

import math

import numpy as np
from flint import arb, ctx
from numpy.typing import NDArray

from workbench._core.arrays import Array
from workbench.certify.balls import Matrix, balls, below, identity, submatrix
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.singularity import (
    proven_bound,
    singular_sizes,
    size_of,
    structured_part,
)
from workbench.certify.stable_system import StableSystem
from workbench.structure import Structure


def without_effect(system: StableSystem, structure: Structure, varies: NDArray[np.bool_]) -> bool:
    """Whether no response leads from the varying blocks back to them, through any fixed blocks.

    The varying blocks then have no effect on the loop. Decided in rational numbers.
    """
    c, r = (np.arange(count) for count in system.D.shape)
    waiting: list[int] = np.flatnonzero(varies).tolist()
    reached: set[int] = set()
    while waiting:
        into = r[structure.row_slices[waiting.pop()]]
        for k in set(range(len(structure))) - reached:
            if not system.channels(c[structure.column_slices[k]], into).vanishes():
                if varies[k]:
                    return False
                reached.add(k)
                waiting.append(k)
    return True


def proven_skew(M: Array, structure: Structure, varies: NDArray[np.bool_], Delta: Array) -> float:
    """As `proven_skew_of`, for a matrix M (c, r) of exact doubles."""
    return proven_skew_of(balls(M), structure, varies, Delta)


def proven_skew_of(
    M: Matrix, structure: Structure, varies: NDArray[np.bool_], Delta: Array
) -> float:
    """The lower bound of the skewed mu of M (c, r) that Delta (r, c) proves; 0: not proven.

    Infinite if the fixed blocks alone make I - M Delta singular. `varies` (blocks,) marks the
    varying blocks.
    """
    if not np.isfinite(Delta).all():
        return 0.0
    Delta = structured_part(structure, Delta)
    rows = np.repeat(varies, [block.rows for block in structure])
    columns = np.repeat(varies, [block.columns for block in structure])
    moving = Structure(b for b, one in zip(structure, varies, strict=True) if one)
    held = np.where(rows[:, None], 0.0, Delta)
    if not Delta[rows].any():
        alone = proven_bound(M, structure, held)
        return math.inf if alone >= 1 else 0.0
    if size_of(structure, held) <= 1:
        with ctx.workprec(PRECISIONS[1]):
            try:
                N = (identity(M.nrows()) - M * balls(held)).solve(M)
                seen = submatrix(N, np.flatnonzero(columns), np.flatnonzero(rows))
            except ZeroDivisionError:
                seen = None
        if seen is not None:
            value = proven_bound(seen, moving, Delta[np.ix_(rows, columns)])
            if value > 0:
                return value
    sizes = singular_sizes(M, structure, Delta)
    if sizes is None or (sizes[~varies] > 1).any() or not sizes[varies].max() > 0:
        return 0.0
    return max(below(arb(1) / arb(float(sizes[varies].max()))), 0.0)
