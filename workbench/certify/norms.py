"""The H-infinity norm of a stable loop, certified on every frequency."""

from __future__ import annotations

import numpy as np

from workbench.arrays import Array, RealArray
from workbench.certify.cover import BandCover, FrequencyBounds, refined_bounds, with_peak
from workbench.certify.stable_system import stable_system
from workbench.heavy_types import StateSpace

NORM_TOLERANCE = 1e-4
"""Relative tolerance of a certified norm: the bound lies at most this far above the norm."""

RESPONSE_ERROR = NORM_TOLERANCE / 100
"""Error of responses, as a share of the largest, above which they are refined. The largest one
decides where the bound begins; it is proven on intervals then."""

INTERVALS_BEFORE_COARSENING = 300
"""Number of intervals after which the tolerance becomes ten times as large. A loop whose response
consists of rounding errors would otherwise need very many intervals."""


def certified_norm(loop: StateSpace) -> float:
    """Upper bound of the H-infinity norm of a stable loop, certified on every frequency.

    The norm is the peak of mu for one full block, whose multipliers are D = 1. Intervals on which
    these multipliers prove the bound cover the band from 0 to infinity, or to half the sampling
    rate.
    """
    parts = [np.asarray(part, dtype=float) for part in (loop.A, loop.B, loop.C, loop.D)]
    key = (*(part.tobytes() for part in parts), parts[3].shape, loop.dt)
    if key not in _norms:  # checks and second opinions ask for the norm of the same loop
        if len(_norms) >= MOST_KEPT:
            _norms.pop(next(iter(_norms)))
        _norms[key] = _certified_norm(loop)
    return _norms[key]


MOST_KEPT = 16
"""Most norms that are kept."""
_norms: dict[tuple[object, ...], float] = {}


def _certified_norm(loop: StateSpace) -> float:
    system = stable_system(loop, sampled=True)
    c, r = system.D.shape

    def bounds_at(omega: RealArray) -> FrequencyBounds:
        M = system.response(omega, RESPONSE_ERROR)
        F = len(omega)
        D_left, D_right = (np.broadcast_to(np.eye(n, dtype=complex), (F, n, n)) for n in (c, r))
        G = np.zeros((F, r, c), complex)
        # Nothing rests on these numbers: intervals prove the bound that begins at the largest.
        return FrequencyBounds(omega, M, largest_singular_value(M), D_left, D_right, G)

    found = refined_bounds(bounds_at, system.poles).joined(bounds_at(np.array([0.0, np.inf])))
    found = with_peak(found, bounds_at)
    cover = BandCover(system, bounds_at, NORM_TOLERANCE, found)
    cover.complete(INTERVALS_BEFORE_COARSENING)
    return cover.proven


def largest_singular_value(M: Array) -> RealArray:
    """The largest singular value of each matrix (F, c, r), (F,), up to rounding.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.certify.norms import largest_singular_value
    >>> largest_singular_value(np.diag([3.0, 4.0])[None]).tolist()
    [4.0]
    """
    c, r = M.shape[-2:]
    if min(c, r) == 0:
        return np.zeros(len(M))
    if min(c, r) > 2:
        return np.linalg.norm(M, 2, axis=(-2, -1))
    rows = M if c <= r else M.mT
    squares = (np.abs(rows) ** 2).sum(axis=-1)
    if len(squares.T) == 1:
        return np.sqrt(squares[:, 0])
    first, second = squares.T
    beside = np.abs((rows[:, 0] * rows[:, 1].conj()).sum(axis=-1))
    return np.sqrt((first + second) / 2 + np.hypot((first - second) / 2, beside))
