"""Multisines, and the complex amplitudes of a periodic record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import InputError
from workbench.identification.experiments.quality import as_record


def line_amplitudes(signal: ArrayLike, samples: int) -> np.ndarray:
    """Complex amplitudes of every line in every period of a periodic record.

    Parameters
    ----------
    signal
        Real, shape (..., N), N a multiple of ``samples``.
    samples
        Samples per period.

    Returns
    -------
    ndarray
        Complex, shape (..., periods, samples // 2 + 1); line 0 is the mean.

    Raises
    ------
    InputError
        The record's length is not a whole number of periods.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import line_amplitudes
    >>> signal = 1 + 3 * np.cos(2 * np.pi * 2 * np.arange(16) / 8)
    >>> abs(line_amplitudes(signal, samples=8)).round(6).tolist()  # two periods, lines 0 to 4
    [[1.0, 0.0, 3.0, 0.0, 0.0], [1.0, 0.0, 3.0, 0.0, 0.0]]
    """
    values = as_record(signal, name="signal")
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
        Positive peak values, one for all lines or one for each.
    phases
        Phases [rad], shape (K,).
    samples
        Samples per period.

    Examples
    --------
    >>> from workbench.identification import Multisine
    >>> signal = Multisine(lines=[1, 3], amplitudes=1.0, phases=[0.0, 0.0], samples=8)
    >>> signal.period().round(6).tolist()[:3], round(signal.crest_factor, 4)
    ([2.0, 0.0, 0.0], 2.0)
    """

    lines: Any
    amplitudes: Any
    phases: Any
    samples: int

    def __post_init__(self) -> None:
        lines, amplitudes = as_lines(self.lines, self.amplitudes, self.samples)
        phases = as_record(self.phases, name="phases")
        if phases.shape != lines.shape:
            raise InputError(f"{len(lines)} lines need as many phases, not {phases.shape}")
        for name, value in (("lines", lines), ("amplitudes", amplitudes), ("phases", phases)):
            object.__setattr__(self, name, value)

    def period(self, *, points: int | None = None) -> np.ndarray:
        """One period at ``points`` equidistant instants; by default at its samples."""
        points = points or self.samples
        spectrum = np.zeros(points // 2 + 1, dtype=complex)
        spectrum[self.lines] = points / 2 * self.amplitudes * np.exp(1j * self.phases)
        return np.fft.irfft(spectrum, points)

    @property
    def crest_factor(self) -> float:
        """Ratio of the largest |sample| to the root mean square."""
        signal = self.period()
        return float(np.abs(signal).max() / np.sqrt(np.mean(signal**2)))


def random_multisine(
    lines: ArrayLike, amplitudes: ArrayLike, samples: int, rng: np.random.Generator
) -> Multisine:
    """A multisine with independent random phases, uniform over the circle.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import random_multisine
    >>> signal = random_multisine([1, 3, 5], 1.0, 64, np.random.default_rng(0))
    >>> signal.period().shape, bool(np.isclose(np.mean(signal.period() ** 2), 3 / 2))
    ((64,), True)
    """
    return Multisine(lines, amplitudes, rng.uniform(0, 2 * np.pi, np.size(lines)), samples)


def odd_lines(
    first: int, last: int, group: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Odd lines to excite, and odd lines that stay silent to reveal nonlinear distortion.

    In every group of ``group`` consecutive odd lines from ``first`` to ``last`` one, chosen at
    random, is silent; all even lines are silent too (Pintelon and Schoukens, System Identification,
    2nd ed., section 5.2).

    Returns
    -------
    excited, silent
        Line numbers, rising.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.identification import odd_lines
    >>> excited, silent = odd_lines(1, 15, group=4, rng=np.random.default_rng(0))
    >>> len(excited), len(silent), set((np.r_[excited, silent] % 2).tolist())
    (6, 2, {1})
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
    """Line numbers (K,) and their amplitudes (K,), or an `InputError`."""
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
    sizes = as_record(np.atleast_1d(amplitudes), name="amplitudes")
    if sizes.size not in (1, numbers.size) or np.any(sizes <= 0):
        raise InputError(f"one positive amplitude or {numbers.size} are needed")
    return numbers, np.broadcast_to(sizes, numbers.shape)
