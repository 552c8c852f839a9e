"""The period of an input, and the differences between its periods."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import RealArray

SHORTEST_PERIOD = 16
"""Shortest period that is searched for [samples]."""
FORGOTTEN = 0.5
"""An input has left its initial state once the correlation falls below this; a period is longer."""
ENERGY_ROUNDING = 1e-9
"""Energy of a part of an input, relative to the whole, that counts as rounding."""
PERIODIC = 0.99
"""Correlation of an input with itself one period later, from which it counts as periodic."""

FEWEST_PERIODS = 4
"""Fewest periods from which it is decided whether their differences are noise."""
ALIKE = 3.0
"""Number of standard deviations by which the correlation of neighbouring periods may exceed that of
noise.
"""


def period(u: RealArray) -> int | None:
    """A record's period [samples], which it must contain at least twice; None if it has none."""
    u = u - u.mean()
    n, longest = len(u), len(u) // 2
    if longest < SHORTEST_PERIOD or not u.any():
        return None
    spectrum = np.fft.rfft(u, 2 * n)
    product = np.fft.irfft(np.abs(spectrum) ** 2)[: longest + 1]
    energy = np.concatenate([[0.0], np.cumsum(u**2)])
    lags = np.arange(longest + 1)
    size = np.sqrt(energy[n - lags] * (energy[n] - energy[lags]))
    # An input that hardly moves resembles anything.
    like = np.where(size > ENERGY_ROUNDING * energy[n], product, 0.0)
    like = np.minimum(like / np.maximum(size, ENERGY_ROUNDING * energy[n]), 1.0)
    left = np.flatnonzero(like < FORGOTTEN)
    if not left.size:
        return None
    start = max(int(left[0]), SHORTEST_PERIOD)
    best = like[start:].max(initial=-1.0)
    if best < PERIODIC:
        return None
    # Every multiple of the period fits equally well: take the first that is as good as the best.
    near = np.flatnonzero(like[start:] >= 1.0 - 2.0 * (1.0 - best) - 1e-9)
    first = start + int(near[0])
    last = first
    while last + 1 <= longest and like[last + 1] > like[last]:
        last += 1
    return last


def common_period(u: RealArray, periods: Sequence[int | None]) -> int | None:
    """Common period [samples] of all channels of an input (N, nu); None if there is none.

    It is the longest of the channels' own `periods`, if the other channels also repeat after it.
    """
    found = [samples for samples in periods if samples is not None]
    if not found or len(found) < u.shape[1]:
        return None
    longest = max(found)
    middle = u - u.mean(axis=0)
    apart = np.sum((middle[longest:] - middle[:-longest]) ** 2, axis=0)
    alike = apart <= 2.0 * (1.0 - PERIODIC) * np.sum(middle**2, axis=0)
    return longest if alike.all() else None


def between_periods(u: RealArray, samples: int) -> RealArray | None:
    """Differences between the periods of an input (N, nu), without the first period.

    None if they are not noise: there are too few periods, or neighbouring periods are more alike
    than noise is, as for a sine whose period is not a whole number of samples.
    """
    count = len(u) // samples - 1
    if count < FEWEST_PERIODS - 1:
        return None
    apart = without_periodic_part(u[-count * samples :], samples)
    energy = np.sum(apart**2, axis=0)
    alike = np.sum(apart[samples:] * apart[:-samples], axis=0) * count / (count - 1)
    # Noise minus its mean over the periods is correlated by this much.
    noise = -1.0 / (count - 1) + ALIKE / np.sqrt(len(apart))
    return apart if np.all(alike <= noise * energy) else None


def without_periodic_part(signal: RealArray, samples: int) -> RealArray:
    """A signal (periods * samples, channels) minus the mean of its periods, ignoring NaN."""
    periods = signal.reshape(-1, samples, signal.shape[1])
    there = ~np.isnan(periods)
    mean = np.where(there, periods, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    return (periods - mean).reshape(signal.shape)
