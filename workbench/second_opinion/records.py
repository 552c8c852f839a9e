"""Models of records, checked by convolution and by plain powers."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import fftconvolve

from workbench._core.arrays import RealArray


def convolved(matrices: Any, u: RealArray, y: RealArray, washout: int) -> RealArray:
    """Output (N, ny) of a sampled system by convolution, with its initial state fitted to y.

    ``matrices`` are A, B, C, D, and u (N, nu) is the input. The measured values among the first
    `washout` samples of y (N, ny) determine the initial state.
    """
    A, B, C, D = matrices
    markov, free = np.empty((len(u), *D.shape)), np.empty((len(u), *C.shape))
    markov[0], row = D, C
    for k in range(len(u)):
        free[k] = row
        if k + 1 < len(u):
            markov[k + 1] = row @ B
        row = row @ A
    forced = sum(
        fftconvolve(u[:, None, j], markov[:, :, j], axes=0)[: len(u)] for j in range(u.shape[1])
    )
    observed = free[:washout].reshape(-1, len(A))
    left = (y - forced)[:washout].ravel()
    known = np.isfinite(left)
    return forced + free @ np.linalg.lstsq(observed[known], left[known], rcond=None)[0]
