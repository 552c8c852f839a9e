"""The stepped sine, and the complex amplitudes of what comes back.

Amplitudes are peak values: a signal is Re(X exp(j omega t)), with t = 0 at its first sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.identification.experiments.quality import as_record

WHOLE = 1e-9
"""Fraction of a sample or period by which a count may miss a whole number through rounding."""


@dataclass(frozen=True, eq=False)
class SteppedSine:
    """A sine that steps through frequencies without a jump in phase.

    Iterating gives ``(frequency, samples)``, one frequency at a time. Each lasts ``periods``
    periods, rounded up to whole samples; the next goes on from the phase reached.

    Parameters
    ----------
    frequencies
        [Hz], shape (F,), between 0 and half the sample rate.
    periods
        At each frequency.
    amplitude
        Peak value, of all or of each frequency.
    sample_rate
        [Hz]
    """

    frequencies: Any  # arrays from here on
    periods: int
    amplitude: Any
    sample_rate: float

    def __post_init__(self) -> None:
        frequencies = as_record(self.frequencies, "frequencies")
        _require_below_nyquist(frequencies, self.sample_rate)
        if self.periods < 1:
            raise InputError(f"at least one period is needed, not {self.periods}")
        amplitude = np.broadcast_to(as_record(np.atleast_1d(self.amplitude)), frequencies.shape)
        object.__setattr__(self, "frequencies", frequencies)
        object.__setattr__(self, "amplitude", amplitude)

    @property
    def lengths(self) -> np.ndarray:
        """Samples at each frequency, shape (F,)."""
        exact = self.periods * self.sample_rate / self.frequencies
        return np.ceil(exact - WHOLE).astype(int)

    def __iter__(self) -> Iterator[tuple[float, np.ndarray]]:
        cycles = 0.0
        for frequency, amplitude, length in zip(
            self.frequencies, self.amplitude, self.lengths, strict=True
        ):
            step = frequency / self.sample_rate
            yield float(frequency), amplitude * np.sin(2 * np.pi * (cycles + step * range(length)))
            cycles = (cycles + step * length) % 1


def sine_fit(
    signal: ArrayLike, sample_rate: float, frequency: float, harmonics: int = 1
) -> np.ndarray:
    """Complex amplitudes of a sine and its harmonics in every whole period of a record.

    A period in time need be no whole number of samples: an offset, sines and cosines are fitted
    by least squares to the samples that fall into each period, which is exact for a periodic
    signal. Samples after the last whole period are left out.

    Parameters
    ----------
    signal
        Real, shape (..., N).
    sample_rate, frequency
        [Hz]
    harmonics
        How many, the fundamental included.

    Returns
    -------
    ndarray
        Complex, shape (..., periods, harmonics).

    Raises
    ------
    InputError
        Less than one period, a harmonic beyond half the sample rate, or fewer samples a period
        than the 2 * harmonics + 1 unknowns.
    """
    values = as_record(signal, "signal")
    _require_below_nyquist(np.array([frequency * harmonics]), sample_rate)
    samples, unknowns = sample_rate / frequency, 2 * harmonics + 1
    if samples < unknowns:
        raise InputError(
            f"{samples:.3g} samples a period cannot tell {unknowns} unknowns (an offset and "
            f"{harmonics} harmonics) at {frequency:g} Hz: sample faster or ask for fewer harmonics"
        )
    periods = int(values.shape[-1] / samples + WHOLE)
    if periods < 1:
        raise InputError(
            f"{values.shape[-1]} samples are less than one period of {frequency:g} Hz at "
            f"{sample_rate:g} Hz: at least {int(np.ceil(samples - WHOLE))} are needed"
        )
    edges = np.ceil(np.arange(periods + 1) * samples - WHOLE).astype(int)
    # Less its first sample, a dead channel has amplitude zero exactly.
    values = values[..., : edges[-1]] - values[..., :1]
    turns = np.exp(2j * np.pi * frequency / sample_rate * np.arange(edges[-1]))
    powers = [turns**n for n in range(1, harmonics + 1)]
    basis = [np.ones(edges[-1])] + [part for z in powers for part in (z.real, -z.imag)]
    starts = edges[:-1]
    gram = np.empty((periods, unknowns, unknowns))
    moments = np.empty((*values.shape[:-1], periods, unknowns))
    for i, one in enumerate(basis):
        moments[..., i] = np.add.reduceat(values * one, starts, axis=-1)
        for j, other in enumerate(basis[: i + 1]):
            gram[:, i, j] = gram[:, j, i] = np.add.reduceat(one * other, starts)
    found = np.linalg.solve(gram, moments[..., None])[..., 0]
    return found[..., 1::2] + 1j * found[..., 2::2]


def _require_below_nyquist(frequencies: np.ndarray, sample_rate: float) -> None:
    if not sample_rate > 0:
        raise InputError(f"the sample rate must be positive, not {sample_rate}")
    wrong = frequencies[~((frequencies > 0) & (frequencies < sample_rate / 2))]
    if wrong.size:
        raise InputError(
            f"{wrong[0]:g} Hz does not lie between 0 and the Nyquist frequency "
            f"{sample_rate / 2:g} Hz: sample faster or stay below"
        )
