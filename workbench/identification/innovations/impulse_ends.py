"""Whether estimated impulse responses have died out where they end.

The effect of inputs before the first sample of a response counts as an error of the model, and
later steps mistake it for a part of the plant. The last quarter of the response shows whether this
effect is small.

Source: L. Ljung, System Identification, 2nd ed., 1999, sections 9.4 (the covariance of a response)
and 6.4 (the spectrum of residuals).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import freqz

from workbench._core.arrays import RealArray
from workbench.identification.innovations.autoregression import chosen_autoregression

ENDED, SURE = 0.02, 3.0
"""A response has ended if its last quarter is smaller than the first number, relative to the whole.

A larger last quarter still counts as noise up to so many (`SURE`) of its standard deviations.
"""
MOST_COLOUR = 4.0
"""Largest ratio of the noise's power at a frequency to its mean.

Stronger slow residuals are taken as the effect of a response that is cut off, not as noise.
"""
FINE = 4096
"""Frequencies over which the spectrum of the residuals is averaged."""


def has_ended(response: RealArray, roots: Sequence[RealArray], residuals: RealArray) -> bool:
    """Whether impulse responses (ny, nu, taps) have died out, as far as the record tells.

    ``roots`` (nu taps, nu taps) are those of the covariance for each output, if the noise is white;
    the residuals (N, ny) tell its spectrum.
    """
    ny, nu, taps = response.shape
    last = np.arange(taps) >= taps - taps // 4
    tail = np.abs(np.fft.rfft(response * last, axis=-1))
    size = np.abs(np.fft.rfft(response, axis=-1)).max(axis=-1, keepdims=True)
    tails = np.reshape(roots, (ny, nu, taps, -1)) * last[:, None]
    colours = np.array([_colour(errors, taps) for errors in residuals.T])
    power = (np.abs(np.fft.rfft(tails, axis=2)) ** 2).sum(axis=-1) * colours[:, None]
    return not ((tail > ENDED * size) & (tail > SURE * np.sqrt(power))).any()


def _colour(errors: RealArray, samples: int) -> RealArray:
    """Spectrum of errors (N,), relative to that of white errors of the same size.

    It is given at the lines of the Fourier transform of ``samples`` samples.
    """
    whitening = np.concatenate([[1.0], -chosen_autoregression(errors)])
    power = 1 / np.abs(np.fft.fft(whitening, FINE)) ** 2
    lines = freqz([1.0], whitening, 2 * np.pi * np.arange(samples // 2 + 1) / samples)[1]
    return np.minimum(np.abs(lines) ** 2 / power.mean(), MOST_COLOUR)
