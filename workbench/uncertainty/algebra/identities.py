"""Scalars on which the value of an LFT does not depend, such as p and q in p q - q p.

For Delta and Delta0 that differ in one scalar only, the values differ by

    M21 (I - Delta M11)^-1 (Delta - Delta0) (I - M11 Delta0)^-1 M12.

The same product with magnitudes bounds the sum of the magnitudes of its terms. Since products and
sums of doubles are rounded, a difference within the rounding of its terms counts as zero. A
rational function that is not constant has equal values at random points with probability 0.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from workbench._core.arrays import EPS
from workbench.uncertainty.algebra.lft import LFT

POINTS = 3
"""Number of random points at which values are compared."""
ROUNDINGS = 4
"""Multiple of the relative rounding error allowed for each channel through which a term passes."""


def cancelling_names(lft: LFT, candidates: Collection[str], *, of_loops: bool = False) -> list[str]:
    """The candidates on which the value does not depend, whatever the values of all other scalars
    are.

    With ``of_loops``, det(I - M11 Delta) does not depend on them either, so that they move no pole.
    """
    r = len(lft.names)
    if len(set(lft.names)) == r or not np.isfinite(lft.M).all():
        return []  # no scalar occurs twice, so nothing can cancel
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
                size = around[np.ix_(own, own)]  # rounding of the terms of `back`
                apart = abs(np.linalg.det(np.eye(len(back)) - back) - 1.0)
                fixed = apart <= share * size.sum() * np.prod(1.0 + size.sum(axis=1))
            if not fixed:
                found.remove(name)
    return found
