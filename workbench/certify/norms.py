"""The H-infinity norm of a stable loop, certified on every frequency."""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray
from workbench.certify.cover import Cover, FrequencyBounds, refined
from workbench.certify.interval import stable_system
from workbench.certify.mu_bound import certified
from workbench.heavy_types import StateSpace
from workbench.structure import Full, Structure
from workbench.systems.bilinear import to_continuous
from workbench.systems.realisation import realisation

CERTIFIED = 1e-4
"""Relative width of the interval in which the norm of a loop is certified."""

STEPS = 50
"""Intervals that should do: a loop whose response is rounding errors needs any number of them."""


def certified_norm(loop: StateSpace) -> float:
    """An upper bound of the norm of a stable loop, on every frequency.

    The norm is the peak of mu for one full block, whose multipliers are D = 1: the band from 0 to
    infinity is covered by intervals on which they prove it. A sampled loop is taken to continuous
    time by the bilinear transform, which keeps norms.
    """
    if loop.dt:
        loop = realisation(to_continuous((loop.A, loop.B, loop.C, loop.D)), 0.0)
    block = Structure([Full(loop.ninputs, loop.noutputs)])
    system = stable_system(loop)
    c, r = system.D.shape

    def bounds_at(omega: RealArray) -> FrequencyBounds:
        M = system.response(omega)
        F = len(omega)
        D_left, D_right = (np.tile(np.eye(n, dtype=complex), (F, 1, 1)) for n in (c, r))
        G = np.zeros((F, r, c), complex)
        return FrequencyBounds(
            omega, M, certified(M, block, D_left, D_right, G), D_left, D_right, G
        )

    found = refined(bounds_at, system.poles).joined(bounds_at(np.array([0.0, np.inf])))
    cover = Cover(system, bounds_at, CERTIFIED, found)
    cover.complete(STEPS)
    return cover.proven
