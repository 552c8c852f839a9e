"""Responses of several plants from their records, each with its variance, on common frequencies.

Where the inputs are periodic, whole periods are averaged (`from_periods`); other records are
estimated by local polynomials. What was found out of the records is said.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.arrays import IntegerArray, RealArray
from workbench.errors import InputError
from workbench.identification.experiments.quality import checked_record
from workbench.identification.record_report.periods import period
from workbench.identification.responses.local_polynomial import (
    line_frequencies,
    local_polynomial,
)
from workbench.identification.responses.periodic import ResponseEstimate, from_periods

EXCITED = 1e-3
"""Amplitude of an excited line, relative to the largest."""
EXCITED_OVER_NOISE = 5.0
"""Amplitude of an excited line over the standard deviation of its mean."""
SETTLED = 2.0
"""Distance of the first period from the later ones, over their own, up to which it is settled."""
LOCAL_DEGREE, LOCAL_LINES = 2, 14
"""Degree of local polynomials, and lines of their bands."""
FEWEST_SAMPLES = 2 * LOCAL_LINES + 1
"""Samples of the shortest record that has so many lines beside its mean."""


def record_responses(
    records: Sequence[tuple[RealArray, RealArray]], sample_rate: float, most: int
) -> tuple[list[ResponseEstimate], str]:
    """Responses from u to y of single-channel records (u (N,), y (N,)), and what was found out.

    Parameters
    ----------
    sample_rate
        Sampling frequency [Hz] of all records.
    most
        Largest number of frequencies; more are thinned to equal steps of log frequency.

    Raises
    ------
    InputError
        As `checked_record`, `from_periods` and `local_polynomial`; or the records have no excited
        lines in common.
    """
    pairs = [
        tuple(part[:, 0] for part in checked_record(u[:, None], y[:, None])) for u, y in records
    ]
    periods = {period(u) for u, _ in pairs}
    length = min(len(u) for u, _ in pairs)
    if len(periods) == 1 and (samples := periods.pop()) is not None and length >= 2 * samples:
        return _periodic(pairs, samples, length // samples, sample_rate, most)
    return _arbitrary(pairs, length, sample_rate, most)


def _periodic(
    pairs: Sequence[tuple[RealArray, ...]], samples: int, count: int, rate: float, most: int
) -> tuple[list[ResponseEstimate], str]:
    """Responses from whole periods, without a first one that has not settled."""
    spectra = [
        tuple(np.fft.rfft(x[-count * samples :].reshape(count, samples)).T for x in pair)
        for pair in pairs
    ]
    unsettled = count > 2 and any(_unsettled(Y) for _, Y in spectra)
    spectra = [(U[:, unsettled:], Y[:, unsettled:]) for U, Y in spectra]
    lines = excited(spectra[0][0])
    for U, _ in spectra[1:]:
        lines = np.intersect1d(lines, excited(U))
    if lines.size < 2:
        raise InputError(
            f"the inputs have {lines.size} excited lines in common; two are needed: excite all "
            "plants by the same signal"
        )
    chosen = _thinned(lines, most)
    frequency = chosen * rate / samples
    found: list[ResponseEstimate] = [
        from_periods(frequency, U[chosen], Y[chosen]) for U, Y in spectra
    ]
    dropped = ", the first left out as not settled" if unsettled else ""
    thinned = f", {chosen.size} taken" if chosen.size < lines.size else ""
    said = f"{count} periods of {samples} samples{dropped}; {lines.size} excited lines{thinned}"
    return found, said


def _arbitrary(
    pairs: Sequence[tuple[RealArray, ...]], length: int, rate: float, most: int
) -> tuple[list[ResponseEstimate], str]:
    """Responses by local polynomials, from records cut to one length."""
    found: list[ResponseEstimate] = []
    frequency = line_frequencies(length)
    at = _thinned(np.arange(1, frequency.size + 1), most, frequency)
    freedom = 2.0 * (LOCAL_LINES - 2 * (LOCAL_DEGREE + 1))
    for u, y in pairs:
        record = u[-length:, None], y[-length:, None]
        local = local_polynomial(*record, LOCAL_DEGREE, LOCAL_LINES, at=at)
        found.append(
            ResponseEstimate(local.frequency * rate, local.response, local.variance, freedom)
        )
    cut = ", cut to one length" if len({len(u) for u, _ in pairs}) > 1 else ""
    lines = found[0].frequency.size
    return found, f"no common period; local polynomials at {lines} lines of {length} samples{cut}"


def _unsettled(Y: np.ndarray) -> bool:
    """Whether the first period differs from the mean of the others by more than they do."""
    rest = Y[:, 1:]
    middle = rest.mean(axis=1, keepdims=True)
    count = rest.shape[1]
    own = np.sum(np.abs(rest - middle) ** 2) / max(count - 1, 1)
    first = np.sum(np.abs(Y[:, :1] - middle) ** 2) / (1 + 1 / count)
    rounding = np.finfo(float).eps * np.sum(np.abs(middle) ** 2)
    return bool(first > SETTLED**2 * own + rounding)


def excited(U: np.ndarray) -> IntegerArray:
    """Lines of amplitudes (lines, periods) that the input excites; not 0, and not the last one."""
    mean = np.abs(U.mean(axis=1))
    spread = U.std(axis=1, ddof=1) / np.sqrt(U.shape[1]) if U.shape[1] > 1 else 0.0
    mean[0] = mean[-1] = 0.0
    return np.flatnonzero((mean > EXCITED * mean.max()) & (mean > EXCITED_OVER_NOISE * spread))


def _thinned(lines: IntegerArray, most: int, place: RealArray | None = None) -> IntegerArray:
    """At most so many of the lines, at equal steps of log frequency where there are enough."""
    if lines.size <= most:
        return lines
    log = np.log(lines if place is None else place)
    wanted = np.linspace(log[0], log[-1], most)
    nearest = np.clip(np.searchsorted(log, wanted), 1, len(log) - 1)
    nearest -= wanted - log[nearest - 1] < log[nearest] - wanted
    return lines[np.unique(nearest)]
