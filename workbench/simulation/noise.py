"""Noise of a given size and band."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from workbench.errors import InputError


def band_limited(
    rng: np.random.Generator, shape: tuple[int, int], rms: float, band: float, rate: float
) -> NDArray[np.float64]:
    """White Gaussian noise (N, channels) of standard deviation `rms` within 0 to `band` [Hz].

    Flat up to the band and nothing beyond. Only the components inside the band are drawn, so that
    a narrow band costs little. Raises InputError unless 0 < band <= rate / 2.
    """
    if not 0.0 < band <= rate / 2:
        raise InputError(f"band is {band} Hz; it must lie in 0 to {rate / 2} Hz, half the rate")
    # Twice the length: the inverse transform is periodic, and its ends must not know each other.
    # And long enough for the band to hold some components.
    length = fft.next_fast_len(max(2 * shape[0], math.ceil(16 * rate / band)), real=True)
    lines = min(int(band / rate * length), (length - 1) // 2)
    spectrum = np.zeros((length // 2 + 1, shape[1]), complex)
    drawn = rng.standard_normal((2, lines, shape[1]))
    spectrum[1 : lines + 1] = (drawn[0] + 1j * drawn[1]) * (rms * length / (2 * lines**0.5))
    return np.ascontiguousarray(fft.irfft(spectrum, length, axis=0)[: shape[0]])
