"""Removal of the fast poles that small perturbations give to controllers.

With a perfect measurement the observer is the faster, the smaller the noise is. As the noise goes
to 0, its poles go to infinity. In the limit these poles disappear: for example, only a static state
feedback remains.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError, schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench.systems.realisation import Matrices

PAIR_ROUNDING = 1e-9
"""Relative difference that rounding may cause between the sizes of a pair's two poles."""


def without_fast_poles(K: Matrices, good: Callable[[Matrices], bool]) -> Matrices:
    """The controller with the fewest of K's slowest poles for which `good` is true; otherwise K.

    The part with the fast poles is replaced by its gain at frequency 0.
    """
    for slow in _splits(np.sort(np.abs(np.linalg.eigvals(K[0])))):
        try:
            fewer = _residualised(K, slow)
        except LinAlgError:
            continue
        if good(fewer):
            return fewer
    return K


def _splits(size: RealArray) -> list[int]:
    """Possible numbers of slowest poles, fewer than all, that do not split a pair; `size` is
    increasing.
    """
    return [k for k in range(len(size)) if k == 0 or size[k] > (1.0 + PAIR_ROUNDING) * size[k - 1]]


def _residualised(K: Matrices, slow: int) -> Matrices:
    """K with only its `slow` slowest poles; the rest becomes a gain that is exact at frequency 0.

    Raises LinAlgError if slow and fast poles cannot be separated.
    """
    A, B, C, D = K
    limit = np.sort(np.abs(np.linalg.eigvals(A)))[slow] / np.sqrt(1.0 + PAIR_ROUNDING)
    T, Q, kept = schur(A, sort=lambda real, imag=0.0: np.hypot(real, imag) < limit)
    if kept != slow:
        raise LinAlgError("the sizes of slow and fast poles are too close to each other")
    inner, across, fast = T[:slow, :slow], T[:slow, slow:], T[slow:, slow:]
    X = solve_sylvester(inner, -fast, -across)
    into, out = Q.T @ B, C @ Q
    B_slow, C_fast = into[:slow] - X @ into[slow:], out[:, slow:] + out[:, :slow] @ X
    gain = C_fast @ np.linalg.solve(fast, into[slow:])
    return inner, B_slow, out[:, :slow], D - gain
