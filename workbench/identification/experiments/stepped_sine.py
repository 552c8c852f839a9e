"""The stepped sine, and the complex amplitudes of a recorded sine.

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
from workbench.input_checks import need_positive

COUNT_ROUNDING = 1e-9
"""Largest distance of a number of samples or periods from an integer that counts as rounding."""


@dataclass(frozen=True, eq=False)
class SteppedSine:
    """A sine that steps through frequencies without a jump in phase.

    Iteration gives ``(frequency, samples)`` for one frequency after another. Each lasts ``periods``
    periods, rounded up to whole samples; the next one continues from the phase reached.

    Parameters
    ----------
    frequencies_hz
        Frequencies [Hz], shape (F,), between 0 and half the sample rate.
    periods
        Number of periods, one for all frequencies or one for each.
    amplitude
        Peak value, one for all frequencies or one for each.
    dt
        Sampling time [s].

    Examples
    --------
    >>> from workbench.identification import SteppedSine
    >>> sine = SteppedSine([10.0, 20.0], periods=2, amplitude=1.0, dt=1 / 1000.0)
    >>> [(frequency, len(samples)) for frequency, samples in sine]
    [(10.0, 200), (20.0, 100)]
    """

    frequencies_hz: Any  # arrays, after construction
    periods: Any
    amplitude: Any
    dt: float

    def __post_init__(self) -> None:
        frequencies = as_record(self.frequencies_hz, name="frequencies_hz")
        _require_below_nyquist(frequencies, self.dt)
        periods = np.broadcast_to(np.atleast_1d(self.periods), frequencies.shape)
        if not np.issubdtype(periods.dtype, np.integer) or periods.min() < 1:
            raise InputError(f"at least one period is needed, in whole numbers, not {self.periods}")
        amplitude = np.broadcast_to(as_record(np.atleast_1d(self.amplitude)), frequencies.shape)
        object.__setattr__(self, "frequencies_hz", frequencies)
        object.__setattr__(self, "periods", periods)
        object.__setattr__(self, "amplitude", amplitude)

    @property
    def lengths(self) -> np.ndarray:
        """Number of samples (F,) at each frequency."""
        exact = self.periods / self.dt / self.frequencies_hz
        return np.ceil(exact - COUNT_ROUNDING).astype(int)

    def __iter__(self) -> Iterator[tuple[float, np.ndarray]]:
        cycles = 0.0
        for frequency, amplitude, length in zip(
            self.frequencies_hz, self.amplitude, self.lengths, strict=True
        ):
            step = frequency * self.dt
            yield float(frequency), amplitude * np.sin(2 * np.pi * (cycles + step * range(length)))
            cycles = (cycles + step * length) % 1


def sine_fit(
    signal: ArrayLike, dt: float, frequency_hz: float, *, harmonics: int = 1
) -> np.ndarray:
    """Complex amplitudes of a sine and its harmonics in every whole period of a record.

    A period need not be a whole number of samples: an offset, sines and cosines are fitted by
    least squares to the samples in each period, which is exact for a periodic signal. Samples
    after the last whole period are ignored.

    Parameters
    ----------
    signal
        Real, shape (..., N).
    dt, frequency_hz
        Sampling time [s] and frequency of the sine [Hz].
    harmonics
        Number of harmonics, including the fundamental.

    Returns
    -------
    ndarray
        Complex, shape (..., periods, harmonics).

    Raises
    ------
    InputError
        The record has less than one period, a harmonic is beyond half the sample rate, or a period
        has fewer samples than the 2 * harmonics + 1 unknowns.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import sine_fit
    >>> time = np.arange(250) / 1000.0
    >>> signal = 0.5 + 2 * np.cos(2 * np.pi * 12 * time) + 0.1 * np.cos(2 * np.pi * 24 * time)
    >>> found = sine_fit(signal, 1e-3, 12.0, harmonics=2)  # in each of three periods
    >>> abs(found).round(6).tolist()
    [[2.0, 0.1], [2.0, 0.1], [2.0, 0.1]]
    """
    values = as_record(signal, name="signal")
    _require_below_nyquist(np.array([frequency_hz * harmonics]), dt)
    samples, unknowns = 1 / dt / frequency_hz, 2 * harmonics + 1
    if samples < unknowns:
        raise InputError(
            f"{samples:.3g} samples a period cannot tell {unknowns} unknowns (an offset and "
            f"{harmonics} harmonics) at {frequency_hz:g} Hz: sample faster or ask for fewer "
            "harmonics"
        )
    periods = int(values.shape[-1] / samples + COUNT_ROUNDING)
    if periods < 1:
        raise InputError(
            f"{values.shape[-1]} samples are less than one period of {frequency_hz:g} Hz at "
            f"{1 / dt:g} Hz: at least {int(np.ceil(samples - COUNT_ROUNDING))} are needed"
        )
    edges = np.ceil(np.arange(periods + 1) * samples - COUNT_ROUNDING).astype(int)
    # With the first sample subtracted, a dead channel has amplitude zero exactly.
    values = values[..., : edges[-1]] - values[..., :1]
    turns = np.exp(2j * np.pi * frequency_hz * dt * np.arange(edges[-1]))
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


def _require_below_nyquist(frequencies: np.ndarray, dt: float) -> None:
    """Raise `InputError` unless all frequencies lie between 0 and half the sampling rate."""
    need_positive(dt, "dt")
    wrong = frequencies[~((frequencies > 0) & (frequencies < 0.5 / dt))]
    if wrong.size:
        raise InputError(
            f"{wrong[0]:g} Hz does not lie between 0 and the Nyquist frequency "
            f"{0.5 / dt:g} Hz: sample faster or stay below"
        )
