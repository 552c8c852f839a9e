"""Rounding by converters that repeats itself with the periods, so that no scatter of them tells it.

Noise of a deviation s from period to period turns the rounding to steps q into noise, too. What is
left of it in the mean of many periods has the variance

    q^2 / (2 pi^2) sum_k exp(-4 pi^2 k^2 s^2 / q^2) / k^2,

which is q^2 / 12 without noise.

Source: B. Widrow, I. Kollar, Quantization Noise, 2008, chapter 4.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.levels import resolution

FEWEST_LEVELS = 64
"""Levels of an input from which on it is taken as measured by a converter, not as set."""
TERMS = np.arange(1.0, 200.0)
"""Terms of the sum."""


def repeated_rounding(signal: RealArray, samples: int, fewest_levels: int = 2) -> float:
    """Variance of a sample's rounding that repeats itself, of whole periods of a signal (N,)."""
    count = len(signal) // samples
    whole = signal[-count * samples :]
    step = resolution(whole)
    if not step > 0 or np.unique(whole).size < fewest_levels:
        return 0.0
    scatter = whole.reshape(count, samples).var(axis=0, ddof=1).mean() if count > 1 else 0.0
    noise = max(scatter - step**2 / 12, 0.0)  # rounding that does not repeat is in the scatter
    terms = np.exp(-4 * np.pi**2 * TERMS**2 * noise / step**2) / TERMS**2
    return float(step**2 / (2 * np.pi**2) * terms.sum())
