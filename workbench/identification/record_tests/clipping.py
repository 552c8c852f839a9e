"""Clipping: an output that stays at an end of its converter's range while it heads beyond.

A signal that settles at its largest value, or has few levels, is not clipped. So either its values
never repeat elsewhere, or a short regression, fitted inside the range, must say that it goes on.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.identification.record_tests.delay import delays
from workbench.identification.record_tests.finding import Finding, Tested
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import resolution
from workbench.identification.record_tests.record import RecordData

PASTS = (4, 2, 1)
"""Lags of the outputs and inputs in the regressions."""
ROWS = 20_000
"""Rows of the regression at most."""
ROWS_EACH = 10
"""Fewest rows for each of its coefficients."""
FEWEST_ARRIVALS = 3
"""Fewest times that the output arrives at the end of its range."""
CERTAIN = 5.0
"""Standard errors by which the output must be expected beyond."""
FEWEST_REPEATS, REPEATED = 10, 0.01
"""Samples at the end of the range at least, and share of equal neighbours elsewhere at most, from
which on exact repetition is no chance."""
ROUNDING = 1e-6
"""Error of a regression, relative to the output, that is no noise."""
STRONG = 0.05
"""Share of clipped samples from which on nothing may be estimated."""


def held_share(signal: RealArray) -> float:
    """Share of samples at the largest value, 0 unless the signal was cut off there.

    It was if it stays there for two samples or more and the line through the two samples before
    exceeds it by more than the converter's step.
    """
    top = np.nanmax(signal)
    at_top = signal == top
    steps = np.abs(np.diff(signal))
    steps = steps[steps > 0]
    if not steps.size:
        return 0.0
    arrival = _arrivals(at_top)
    heading = 2 * signal[arrival - 1] - signal[arrival - 2] > top + steps.min()
    return float(at_top.mean()) if heading.any() else 0.0


def _arrivals(at_top: BoolArray) -> IntegerArray:
    """Samples at which a signal arrives at its largest value, to stay for another sample."""
    return np.flatnonzero(~at_top[1:-2] & at_top[2:-1] & at_top[3:]) + 2


def clipping(record: RecordData) -> Tested:
    """Whether outputs stay inside the range of their converters."""
    clean = unflagged(record)
    found = []
    for i, name in enumerate(record.outputs):
        for end, sign in (("largest", 1.0), ("least", -1.0)):
            signal = sign * clean.y[:, i]
            share = held_share(signal)
            if share and _beyond(clean, signal, i):
                value = sign * float(np.nanmax(signal))
                found.append(
                    Finding(
                        "clipped",
                        f"{name!r} is cut off at its {end} value {value:.6g}, in {share:.2%} "
                        "of the samples",
                        f"output {name!r}, wherever it is {value:.6g}",
                        share,
                        "share of the samples that are cut off",
                        "take a wider range or excite less; or give these samples as NaN",
                        forbids=share > STRONG,
                    )
                )
    told = "some are cut off" if found else "no output heads beyond its largest or least value"
    return Tested("outputs stay inside their range", told, findings=tuple(found))


def _beyond(record: RecordData, signal: RealArray, output: int) -> bool:
    """Whether an output (N,) would go beyond its largest value where it arrives there.

    Shorter regressions are asked where longer ones have too few rows inside the range.
    """
    waits = [one.most or 0 for one in delays(record) if one.output == output]
    top, bottom = np.nanmax(signal), np.nanmin(signal)
    outside = ~np.isfinite(signal) | (signal == top)
    if held_share(-signal):
        outside |= signal == bottom
    at = np.arange(len(signal))
    since = at - np.maximum.accumulate(np.where(outside, at, -1))  # samples since the last one
    arrivals = _arrivals(signal == top)
    noisy = _never_repeats(signal, outside) and np.sum(signal == top) >= FEWEST_REPEATS
    for past in PASTS:
        begin = np.zeros(len(signal), dtype=bool)
        for piece in record.pieces():
            begin[piece.start : piece.start + past + max([0, *waits])] = True
        rows = np.flatnonzero((since > past) & ~begin)
        rows = rows[:: max(1, -(-len(rows) // ROWS))]
        here = arrivals[~begin[arrivals] & (since[arrivals - 1] >= past)][:ROWS]
        basis = _regressors(record, signal, rows, past, waits)
        if len(here) < FEWEST_ARRIVALS or len(rows) < ROWS_EACH * basis.shape[1]:
            continue
        size = np.maximum(np.abs(basis).max(axis=0), np.finfo(float).tiny)
        weight = np.linalg.lstsq(basis / size, signal[rows], rcond=None)[0] / size
        noise = float(np.std(signal[rows] - basis @ weight))
        exact = ROUNDING * float(np.std(signal[rows]))
        if noisy and noise > exact:
            return True
        away = _regressors(record, signal, here, past, waits) @ weight - top
        least = max(CERTAIN * noise / np.sqrt(len(away)), resolution(signal), exact)
        if away.mean() > least and (away > 0).mean() > 0.5:
            return True
    return False


def _never_repeats(signal: RealArray, outside: BoolArray) -> bool:
    """Whether the values of a signal (N,) inside its range are noisy and not of a converter.

    Then a largest value that repeats exactly is an end of the range.
    """
    both = ~outside[1:] & ~outside[:-1]
    equal = (signal[1:] == signal[:-1])[both]
    return bool(equal.size and equal.mean() < REPEATED and not resolution(signal[~outside]))


def _regressors(
    record: RecordData, signal: RealArray, at: IntegerArray, past: int, waits: list[int]
) -> RealArray:
    """A level, past outputs, and present and past inputs at samples (R,)."""
    outputs = [signal[at - k] for k in range(1, past + 1)]
    inputs = [record.u[at - wait - k, j] for j, wait in enumerate(waits) for k in range(past + 1)]
    return np.column_stack([np.ones(len(at)), *outputs, *inputs])
