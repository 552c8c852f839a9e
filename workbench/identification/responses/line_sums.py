"""Lines of the Fourier transform of a long periodic record, summed period by period.

A record of P periods has its excitation at every P-th line; noise and transients are at all lines.
A local method needs only the lines k P + r near some harmonics k. The memory for their sums depends
on the period alone, however long the record is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.errors import InputError
from workbench.input_checks import need_count


class LineSums:
    """The transform of records at the lines k P + r, from samples that arrive in pieces.

    Parameters
    ----------
    period
        Period of the record [samples].
    periods
        Total number P of periods in the record.
    harmonics
        Harmonics k (F,) of the period, from 1 to below half the period in samples.
    reach
        Largest r.

    Raises
    ------
    InputError
        Numbers out of range.
    """

    def __init__(self, period: int, periods: int, harmonics: ArrayLike, reach: int) -> None:
        for name, value in {"period": period, "periods": periods, "reach": reach}.items():
            need_count(name, value)
        given = np.asarray(harmonics)
        whole = given.ndim == 1 and given.size and np.issubdtype(given.dtype, np.integer)
        last = (period - 1) // 2
        if not whole or given[0] < 1 or given[-1] > last or (np.diff(given) <= 0).any():
            raise InputError(
                f"harmonics must be rising whole numbers, (F,), from 1 to {last}, not "
                f"{harmonics!r:.60}"
            )
        self.period, self.periods, self.harmonics = int(period), int(periods), given
        self.offsets: IntegerArray = np.arange(-reach, reach + 1)
        self.done = 0
        self._sums: ComplexArray | None = None
        self._waiting: list[RealArray] = []
        self._held = 0

    def add(self, samples: ArrayLike) -> None:
        """Add the next samples (N, channels) of the record.

        Raises
        ------
        InputError
            The number of channels has changed, samples are not finite, or there are more than
            announced.
        """
        piece = np.asarray(samples, float)
        if piece.ndim != 2 or not np.isfinite(piece).all():
            raise InputError(f"finite samples (N, channels) are needed, not {piece.shape}")
        if self._sums is None:
            shape = self.offsets.size, self.harmonics.size, piece.shape[1]
            self._sums = np.zeros(shape, complex)
        if piece.shape[1] != self._sums.shape[2]:
            raise InputError(f"{piece.shape[1]} channels after {self._sums.shape[2]}")
        missing = self.period * (self.periods - self.done) - self._held
        if len(piece) > missing:
            raise InputError(f"{len(piece)} samples, but only {missing} of the record are missing")
        self._waiting.append(piece)
        self._held += len(piece)
        if self._held < self.period:
            return
        joined = np.concatenate(self._waiting)
        whole = len(joined) // self.period
        for k in range(whole):
            self._add_period(joined[k * self.period : (k + 1) * self.period])
        rest = joined[whole * self.period :]
        self._waiting, self._held = [rest.copy()], len(rest)

    def _add_period(self, x: RealArray) -> None:
        """Add one period (samples, channels): a modulated transform for each offset."""
        assert self._sums is not None
        total = self.period * self.periods
        turn = np.arange(self.period) + self.done * self.period
        for i, offset in enumerate(self.offsets):
            wave = np.exp(-2j * np.pi * (offset * turn % total) / total)
            spectrum = np.fft.fft(x * wave[:, None], axis=0)
            self._sums[i] += spectrum[self.harmonics]
        self.done += 1

    def transform(self) -> ComplexArray:
        """The transform (offsets, F, channels), scaled by 1 / sqrt(N), of the whole record.

        Raises
        ------
        InputError
            Samples are missing.
        """
        if self._sums is None or self.done < self.periods:
            raise InputError(f"{self.done} of {self.periods} periods have arrived")
        found: ComplexArray = self._sums / np.sqrt(self.period * self.periods)
        return found
