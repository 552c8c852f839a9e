"""Periodic excitation, and the complex amplitudes of what comes back.

Amplitudes are peak values: a signal is Re(X exp(j omega t)), with t = 0 at its first sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.identification.quality import as_record

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


def line_amplitudes(signal: ArrayLike, samples: int) -> np.ndarray:
    """Complex amplitudes of every line in every period of a periodic record.

    Parameters
    ----------
    signal
        Real, shape (..., N), N a multiple of ``samples``.
    samples
        Per period.

    Returns
    -------
    ndarray
        Complex, shape (..., periods, samples // 2 + 1); line 0 is the mean.

    Raises
    ------
    InputError
        The record is no whole number of periods.
    """
    values = as_record(signal, "signal")
    if samples < 2:
        raise InputError(f"a period needs two samples or more, not {samples}")
    periods, rest = divmod(values.shape[-1], samples)
    if rest or not periods:
        raise InputError(
            f"{values.shape[-1]} samples are {periods} periods of {samples} and {rest} samples "
            "over: cut the record to whole periods, or use a method for arbitrary records"
        )
    offset = values[..., :1]
    cut = (values - offset).reshape(*values.shape[:-1], periods, samples)
    lines = np.fft.rfft(cut, axis=-1) * (2 / samples)
    lines[..., 0] = lines[..., 0] / 2 + offset
    if samples % 2 == 0:
        lines[..., -1] /= 2
    return lines


@dataclass(frozen=True, eq=False)
class Multisine:
    """A sum of harmonics: amplitude_k cos(2 pi line_k n / samples + phase_k).

    Parameters
    ----------
    lines
        Harmonic numbers, shape (K,), rising, above 0 and below samples / 2. The frequency of a
        line is line * sample rate / samples.
    amplitudes
        Peak values, of all or of each line, positive.
    phases
        [rad], shape (K,).
    samples
        Per period.
    """

    lines: Any
    amplitudes: Any
    phases: Any
    samples: int

    def __post_init__(self) -> None:
        lines, amplitudes = as_lines(self.lines, self.amplitudes, self.samples)
        phases = as_record(self.phases, "phases")
        if phases.shape != lines.shape:
            raise InputError(f"{len(lines)} lines need as many phases, not {phases.shape}")
        for name, value in (("lines", lines), ("amplitudes", amplitudes), ("phases", phases)):
            object.__setattr__(self, name, value)

    def period(self, points: int | None = None) -> np.ndarray:
        """One period, at ``points`` instants (default: its samples)."""
        points = points or self.samples
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        spectrum[self.lines] = points / 2 * self.amplitudes * np.exp(1j * self.phases)
        return np.fft.irfft(spectrum, points)

    @property
    def crest_factor(self) -> float:
        """Largest sample over the root mean square."""
        signal = self.period()
        return float(np.abs(signal).max() / np.sqrt(np.mean(signal**2)))


def random_multisine(
    lines: ArrayLike, amplitudes: ArrayLike, samples: int, rng: np.random.Generator
) -> Multisine:
    """A multisine of independent phases, uniform over the circle."""
    return Multisine(lines, amplitudes, rng.uniform(0, 2 * np.pi, np.size(lines)), samples)


def odd_lines(
    first: int, last: int, group: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Odd lines to excite, and odd lines left silent to detect nonlinear distortion.

    Of every ``group`` consecutive odd lines from ``first`` to ``last`` a random one is silent, as
    all even lines are (Pintelon and Schoukens, System Identification, 2nd ed., section 5.2).

    Returns
    -------
    excited, silent
        Line numbers, rising.
    """
    if group < 2:
        raise InputError(f"a group needs two lines or more to leave one silent, not {group}")
    odd = np.arange(first + (first + 1) % 2, last + 1, 2)
    groups = len(odd) // group
    if first < 1 or not groups:
        raise InputError(f"no {group} odd lines lie between {first} and {last}")
    silent = odd[np.arange(groups) * group + rng.integers(group, size=groups)]
    return np.setdiff1d(odd, silent), silent


def as_lines(
    lines: ArrayLike, amplitudes: ArrayLike, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Line numbers and their amplitudes, checked and of one shape (K,)."""
    numbers = np.atleast_1d(np.asarray(lines))
    if numbers.dtype.kind not in "iu" or numbers.ndim != 1 or numbers.size == 0:
        raise InputError("lines must be whole numbers, one or more")
    if numbers[0] < 1 or np.any(np.diff(numbers) <= 0):
        raise InputError("lines must rise from 1 or above, each once")
    if 2 * numbers[-1] >= samples:
        raise InputError(
            f"line {numbers[-1]} is not below half of the {samples} samples a period (Nyquist): "
            "use more samples or lower lines"
        )
    sizes = as_record(np.atleast_1d(amplitudes), "amplitudes")
    if sizes.size not in (1, numbers.size) or np.any(sizes <= 0):
        raise InputError(f"one positive amplitude or {numbers.size} are needed")
    return numbers, np.broadcast_to(sizes, numbers.shape)


def _require_below_nyquist(frequencies: np.ndarray, sample_rate: float) -> None:
    if not sample_rate > 0:
        raise InputError(f"the sample rate must be positive, not {sample_rate}")
    wrong = frequencies[~((frequencies > 0) & (frequencies < sample_rate / 2))]
    if wrong.size:
        raise InputError(
            f"{wrong[0]:g} Hz does not lie between 0 and the Nyquist frequency "
            f"{sample_rate / 2:g} Hz: sample faster or stay below"
        )
