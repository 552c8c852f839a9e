"""The H-infinity norm of a stable loop, certified on every frequency."""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray
from workbench.certify.cover import BandCover, FrequencyBounds, refined_bounds, with_peak
from workbench.certify.mu_bound import certified_bound
from workbench.certify.stable_system import stable_system
from workbench.heavy_types import StateSpace
from workbench.structure import Full, Structure

NORM_TOLERANCE = 1e-4
"""Relative tolerance of a certified norm: the bound lies at most this far above the norm."""

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
    block = Structure([Full(loop.ninputs, loop.noutputs)])
    system = stable_system(loop, sampled=True)
    c, r = system.D.shape

    def bounds_at(omega: RealArray) -> FrequencyBounds:
        M = system.response(omega)
        F = len(omega)
        D_left, D_right = (np.tile(np.eye(n, dtype=complex), (F, 1, 1)) for n in (c, r))
        G = np.zeros((F, r, c), complex)
        return FrequencyBounds(
            omega, M, certified_bound(M, block, D_left, D_right, G), D_left, D_right, G
        )

    found = refined_bounds(bounds_at, system.poles).joined(bounds_at(np.array([0.0, np.inf])))
    found = with_peak(found, bounds_at)
    cover = BandCover(system, bounds_at, NORM_TOLERANCE, found)
    cover.complete(INTERVALS_BEFORE_COARSENING)
    return cover.proven
