"""Scalars on which the value of an LFT does not depend, as p and q in p q - q p.

With Delta and Delta0, which differ in one scalar alone, the values differ by

    M21 (I - Delta M11)^-1 (Delta - Delta0) (I - M11 Delta0)^-1 M12.

The same product of sizes bounds the sum of the sizes of its terms. Products and sums of doubles are
rounded, so a difference within rounding of its terms is none. A rational function that is not
constant has equal values at random points with a probability of 0.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from workbench._core.arrays import EPS
from workbench.uncertainty.algebra.lft import LFT

POINTS = 3
"""Random points at which values are compared."""
ROUNDINGS = 4
"""Multiple of the relative rounding error of each channel on the way of a term."""


def cancelling_names(lft: LFT, candidates: Collection[str], *, of_loops: bool = False) -> list[str]:
    """Those candidates on which the value does not depend, each other scalar being arbitrary.

    ``of_loops``: on which det(I - M11 Delta) does not depend either, so that they move no pole.
    """
    r = len(lft.names)
    if len(set(lft.names)) == r or not np.isfinite(lft.M).all():
        return []  # nothing occurs twice, so that nothing cancels
    M11, M12, M21, _ = lft.blocks
    sizes = np.abs(M11)
    radius = 0.5 / max(float(np.abs(np.linalg.eigvals(sizes)).max()), 0.5)
    terms = np.linalg.inv(np.eye(r) - radius * sizes)
    left, right = np.abs(M21) @ terms, terms @ np.abs(M12)
    around = radius * terms @ sizes
    rng = np.random.default_rng(0)
    found = [name for name in candidates if name in lft.names]
    for _ in range(POINTS):
        turns = {name: np.exp(2j * np.pi * rng.random()) for name in dict.fromkeys(lft.names)}
        delta = radius * np.array([turns[name] for name in lft.names])
        before = M21 @ np.linalg.inv(np.eye(r) - delta[:, None] * M11)
        for name in list(found):
            own = np.array([one == name for one in lft.names])
            loop = np.eye(r) - M11 * np.where(own, 0.0, delta)
            moved = (before[:, own] * delta[own]) @ np.linalg.solve(loop, M12)[own]
            share = ROUNDINGS * EPS * r
            fixed = (np.abs(moved) <= share * radius * left[:, own] @ right[own]).all()
            if fixed and of_loops:
                back = np.linalg.solve(loop, M11)[np.ix_(own, own)] * delta[own]
                size = around[np.ix_(own, own)]  # of the terms of `back`
                apart = abs(np.linalg.det(np.eye(len(back)) - back) - 1.0)
                fixed = apart <= share * size.sum() * np.prod(1.0 + size.sum(axis=1))
            if not fixed:
                found.remove(name)
    return found
