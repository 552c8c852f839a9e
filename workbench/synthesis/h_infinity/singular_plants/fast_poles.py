"""Controllers without the fast poles that small perturbations give them.

A perfect measurement lets an observer be as fast as its noise is small, so its poles go to infinity
as the noise goes to 0. In the limit they are gone: the state feedback, say, is static.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import LinAlgError, schur, solve_sylvester

from workbench._core.arrays import RealArray
from workbench.systems.realisation import Matrices

PAIR_ROUNDING = 1e-9
"""Share by which rounding may part the sizes of the poles of a pair."""


def without_fast_poles(K: Matrices, good: Callable[[Matrices], bool]) -> Matrices:
    """The good controller with the fewest of the slowest poles of K, else K.

    The parts of the fast poles are replaced by their gain at frequency 0.
    """
    for slow in _numbers(np.sort(np.abs(np.linalg.eigvals(K[0])))):
        try:
            fewer = _residualised(K, slow)
        except LinAlgError:
            continue
        if good(fewer):
            return fewer
    return K


def _numbers(size: RealArray) -> list[int]:
    """Numbers of slowest poles, less than all, that part no pair; of ascending sizes of poles."""
    return [k for k in range(len(size)) if k == 0 or size[k] > (1.0 + PAIR_ROUNDING) * size[k - 1]]


def _residualised(K: Matrices, slow: int) -> Matrices:
    """K with all but its slowest poles replaced by a gain, exact at frequency 0.

    Raises LinAlgError where the poles cannot be parted.
    """
    A, B, C, D = K
    limit = np.sort(np.abs(np.linalg.eigvals(A)))[slow] / np.sqrt(1.0 + PAIR_ROUNDING)
    T, Q, kept = schur(A, sort=lambda real, imag=0.0: np.hypot(real, imag) < limit)
    if kept != slow:
        raise LinAlgError("the poles are too near each other in size")
    inner, across, fast = T[:slow, :slow], T[:slow, slow:], T[slow:, slow:]
    X = solve_sylvester(inner, -fast, -across)
    into, out = Q.T @ B, C @ Q
    B_slow, C_fast = into[:slow] - X @ into[slow:], out[:, slow:] + out[:, :slow] @ X
    gain = C_fast @ np.linalg.solve(fast, into[slow:])
    return inner, B_slow, out[:, :slow], D - gain
