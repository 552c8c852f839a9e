"""Noise of a given standard deviation and bandwidth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from workbench.errors import InputError


def band_limited_noise(
    rng: np.random.Generator, shape: tuple[int, int], rms: float, band_hz: float, dt: float
) -> NDArray[np.float64]:
    """Gaussian noise (N, channels) of standard deviation `rms`, white from 0 to `band_hz` [Hz].

    The spectrum is flat up to the band and zero beyond, at the sampling time `dt` [s]. Only
    components inside the band are drawn, so a narrow band takes little time. Raises InputError
    unless 0 < band <= rate / 2.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import band_limited_noise
    >>> rng = np.random.default_rng(0)
    >>> noise = band_limited_noise(rng, (10000, 1), rms=2.0, band_hz=100.0, dt=1 / 1000.0)
    >>> noise.shape, bool(abs(noise.std() / 2.0 - 1) < 0.1)
    ((10000, 1), True)
    """
    rate = 1 / dt
    if not 0.0 < band_hz <= rate / 2:
        raise InputError(
            f"band_hz is {band_hz} Hz; it must lie in 0 to {rate / 2} Hz, half the rate"
        )
    # Take twice the length: the inverse transform is periodic, but the ends of the noise must be
    # independent. Also make it so long that the band contains some components.
    length = fft.next_fast_len(max(2 * shape[0], math.ceil(16 * rate / band_hz)), real=True)
    lines = min(int(band_hz / rate * length), (length - 1) // 2)
    spectrum = np.zeros((length // 2 + 1, shape[1]), complex)
    drawn = rng.standard_normal((2, lines, shape[1]))
    spectrum[1 : lines + 1] = (drawn[0] + 1j * drawn[1]) * (rms * length / (2 * lines**0.5))
    return np.ascontiguousarray(fft.irfft(spectrum, length, axis=0)[: shape[0]])
