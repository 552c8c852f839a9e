"""Sizes of the channels of matrices."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray

EQUILIBRATIONS = 30
"""Number of rounds that compute the sizes. Each halves the logarithm of what is left, so 30 leave
1e-9. Half still leaves 3e-5, which is enough for units; double changes nothing.
"""


def equilibrated(entries: RealArray) -> tuple[RealArray, RealArray]:
    """Sizes of rows (F, p) and of columns (F, m) whose products are at least the entries (F, p, m).

    They make the largest entry of each row and of each column 1 (D. Ruiz, "A scaling algorithm to
    equilibrate both rows and columns norms in matrices", 2001). A channel without entries gets the
    smallest size of the others.
    """
    largest = entries.max(axis=(1, 2), keepdims=True)
    entries = entries / largest
    rows, columns = np.ones(entries.shape[:2]), np.ones(entries.shape[::2])
    for _ in range(EQUILIBRATIONS):
        scaled = entries / (rows[:, :, None] * columns[:, None])
        for size, axis in ((rows, 2), (columns, 1)):
            peak = np.sqrt(scaled.max(axis=axis))
            size *= np.where(peak > 0, peak, 1.0)
    for size, axis in ((rows, 2), (columns, 1)):
        dead = entries.max(axis=axis) == 0
        least = np.where(dead, np.inf, size).min(axis=1, keepdims=True)
        size[:] = np.where(dead, least, size)
    scaled = entries / (rows[:, :, None] * columns[:, None])
    return rows * scaled.max(axis=(1, 2))[:, None] * largest[:, 0], columns
