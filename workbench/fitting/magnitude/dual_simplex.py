"""Linear programs of few variables and many rows, by the dual simplex method on dense rows.

The programs of differential correction have about a dozen variables, so a pivot costs little more
than one product of the rows with a vector. Each pivot replaces one of the working rows by the row
that is violated most, as in E. Remez's exchange. An optimal working set remains a valid start when
further rows are added.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import RealArray
from workbench._core.compiled import unchecked

ROW_TOLERANCE = 1e-11
"""Largest violation of a row of unit length that counts as none."""
PIVOT_TOLERANCE = 1e-9
"""Smallest share of a working row in the entering one that counts as a pivot."""
MULTIPLIER_ROUNDING = 1e-13
"""Rounding errors of the multipliers of the working rows, relative to the largest."""
PIVOTS_PER_VARIABLE = 60
"""Largest number of pivots per variable; more are a sign of cycling."""
PIVOTS_BETWEEN_INVERSIONS = 20
"""Number of updates of the inverse of the working rows before it is computed anew."""


class DualSimplex:
    """Maximises gain @ y over all y with rows @ y <= right and |y_j| <= box.

    Parameters
    ----------
    gain
        Objective (n,).
    box
        Bound on every variable, so large that none reaches it at an optimum.
    """

    def __init__(self, gain: RealArray, box: float) -> None:
        count, self._gain = gain.size, gain
        sides = np.where(gain >= 0, 1.0, -1.0)
        self._rows = np.concatenate([np.diag(sides), np.diag(-sides)])
        self._right = np.full(2 * count, box)
        self._working = np.arange(count)

    def add(self, rows: RealArray, right: RealArray) -> None:
        """Add rows (m, n) with right-hand sides (m,); they are scaled to unit length."""
        size = np.linalg.norm(rows, axis=1)
        size[size == 0.0] = 1.0
        self._rows = np.concatenate([self._rows, rows / size[:, None]])
        self._right = np.concatenate([self._right, right / size])

    def solve(self) -> RealArray | None:
        """The optimum (n,); None if no point satisfies the rows, or if rounding hides it.

        The pivots continue from the last optimum; if rounding spoils that, they start anew.
        """
        for working in (self._working, np.arange(self._gain.size)):
            try:
                y, solved = _pivoted(self._rows, self._right, self._gain, working)
            except np.linalg.LinAlgError:
                continue
            if solved:
                self._working = working
                return np.asarray(y)
        return None


@unchecked
def _pivoted(
    rows: RealArray, right: RealArray, gain: RealArray, working: NDArray[np.int_]
) -> tuple[RealArray, bool]:
    """The optimum from a dual feasible working set (n,), replaced by that of the optimum."""
    count = gain.size
    inverse = np.linalg.inv(rows[working])
    y = inverse @ right[working]
    multipliers = gain @ inverse
    since = 0
    for _ in range(PIVOTS_PER_VARIABLE * count):
        beyond = rows @ y - right
        enters = int(np.argmax(beyond))
        done = beyond[enters] <= ROW_TOLERANCE
        if done:
            if since == 0:
                return y, True
        else:
            share = rows[enters] @ inverse
            # Harris: among the rows that may leave, up to rounding, the one with the largest pivot
            # leaves.
            small = MULTIPLIER_ROUNDING * np.abs(multipliers).max()
            most = np.inf
            for k in range(count):
                if share[k] > PIVOT_TOLERANCE:
                    most = min(most, (max(multipliers[k], 0.0) + small) / share[k])
            leaves, pivot = -1, 0.0
            for k in range(count):
                if share[k] > max(PIVOT_TOLERANCE, pivot) and multipliers[k] <= most * share[k]:
                    leaves, pivot = k, share[k]
            if leaves < 0:
                return y, False
            working[leaves] = enters
            since += 1
        if done or since >= PIVOTS_BETWEEN_INVERSIONS:
            inverse = np.linalg.inv(rows[working])
            since = 0
        else:
            column = inverse[:, leaves] / pivot
            for k in range(count):
                if k != leaves:
                    for j in range(count):
                        inverse[j, k] -= column[j] * share[k]
            inverse[:, leaves] = column
        y = inverse @ right[working]
        multipliers = gain @ inverse
    return y, False
