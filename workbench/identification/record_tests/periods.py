"""The period of an input, where it repeats."""

from __future__ import annotations

import numpy as np

from workbench.arrays import RealArray

SHORTEST_PERIOD = 16
"""Samples of the shortest period that is looked for."""
FORGOTTEN = 0.5
"""Correlation below which the input has left its first state: a period is longer."""
ROUNDING = 1e-9
"""Energy of a part of an input, relative to the whole, that is rounding."""
PERIODIC = 0.99
"""Correlation of the input with itself, a period later, from which it counts as periodic."""


def period(u: RealArray) -> int | None:
    """Samples of a record's period, of which it holds two at least; None where it has none."""
    u = u - u.mean()
    n, longest = len(u), len(u) // 2
    if longest < SHORTEST_PERIOD or not u.any():
        return None
    spectrum = np.fft.rfft(u, 2 * n)
    product = np.fft.irfft(np.abs(spectrum) ** 2)[: longest + 1]
    energy = np.concatenate([[0.0], np.cumsum(u**2)])
    lags = np.arange(longest + 1)
    size = np.sqrt(energy[n - lags] * (energy[n] - energy[lags]))
    # Where an input hardly moves it is like anything.
    like = np.where(size > ROUNDING * energy[n], product, 0.0)
    like = np.minimum(like / np.maximum(size, ROUNDING * energy[n]), 1.0)
    left = np.flatnonzero(like < FORGOTTEN)
    if not left.size:
        return None
    start = max(int(left[0]), SHORTEST_PERIOD)
    best = like[start:].max(initial=-1.0)
    if best < PERIODIC:
        return None
    # Every multiple of the period is as good: take the first one that is as near as the best.
    near = np.flatnonzero(like[start:] >= 1.0 - 2.0 * (1.0 - best) - 1e-9)
    first = start + int(near[0])
    last = first
    while last + 1 <= longest and like[last + 1] > like[last]:
        last += 1
    return last
