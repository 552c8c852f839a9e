"""Upper bounds of mu for a batch of matrices, eight at a time."""

from __future__ import annotations

import numpy as np

from workbench.compiled import compiled
from workbench.mu.upper.lanes.path import follow_eight
from workbench.mu.upper.lanes.simd import LANES
from workbench.mu.upper.lanes.state import Places, room_for

START = 1.05
"""First t over the square of the Frobenius norm."""


@compiled
def solve_lanes(
    batch: np.ndarray,
    places: Places,
    accuracy: float,
    D: np.ndarray,
    G: np.ndarray,
    gaps: np.ndarray,
    iterations: np.ndarray,
) -> None:
    """D (F, N) and G (F, q) of matrices (F, c, r), gaps (F,) and iterations (F,).

    Lanes without a matrix of their own repeat the last one.
    """
    count, c, r = batch.shape
    N, q = places.blocks, places.row.size
    lanes = room_for(places)
    t, gap, used = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES, np.int64)
    for start in range(0, count, LANES):
        t[:] = 0.0
        for w in range(LANES):
            f = min(start + w, count - 1)
            for i in range(c):
                for j in range(r):
                    entry, at = batch[f, i, j], (i * r + j) * 2 * LANES
                    lanes.M[at + w], lanes.M[at + LANES + w] = entry.real, entry.imag
                    t[w] += START * (entry.real**2 + entry.imag**2)
        follow_eight(places, lanes, t, accuracy, gap, used)
        for w in range(min(LANES, count - start)):
            for k in range(N):
                D[start + w, k] = lanes.x[k * LANES + w]
            for k in range(q):
                G[start + w, k] = lanes.x[(N + k) * LANES + w]
            gaps[start + w], iterations[start + w] = gap[w], used[w]
