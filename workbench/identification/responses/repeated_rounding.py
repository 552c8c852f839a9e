"""Converter rounding that repeats with the periods, so that the scatter does not show it.

Noise with standard deviation s from period to period turns rounding to steps q into noise too. The
part that remains in the mean of many periods has the variance

    q^2 / (2 pi^2) sum_k exp(-4 pi^2 k^2 s^2 / q^2) / k^2,

which is q^2 / 12 without noise.

Source: B. Widrow, I. Kollar, Quantization Noise, 2008, chapter 4.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.record_tests.levels import resolution

FEWEST_LEVELS = 64
"""Fewest levels from which an input counts as measured by a converter, and not as a set value."""
TERMS = np.arange(1.0, 200.0)
"""Indices k of the terms of the sum."""


def repeated_rounding(signal: RealArray, samples: int, fewest_levels: int = 2) -> float:
    """Variance of the rounding that repeats in whole periods of a signal (N,)."""
    count = len(signal) // samples
    whole = signal[-count * samples :]
    step = resolution(whole)
    if not step > 0 or np.unique(whole).size < fewest_levels:
        return 0.0
    scatter = whole.reshape(count, samples).var(axis=0, ddof=1).mean() if count > 1 else 0.0
    noise = max(scatter - step**2 / 12, 0.0)  # rounding that does not repeat is part of the scatter
    terms = np.exp(-4 * np.pi**2 * TERMS**2 * noise / step**2) / TERMS**2
    return float(step**2 / (2 * np.pi**2) * terms.sum())
