"""Clipping: an output that stays at an end of its converter's range although it would go further.

A signal that settles at its largest value, or that has few levels, is not clipped. So one more sign
is needed: either its values never repeat elsewhere, or a short regression, fitted inside the range,
predicts a value beyond the end.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.identification.record_tests.delay import delays
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import resolution
from workbench.identification.record_tests.record import RecordData

PASTS = (4, 2, 1)
"""Numbers of lags of outputs and inputs in the regressions."""
ROWS = 20_000
"""Most rows of the regression."""
ROWS_EACH = 10
"""Fewest rows for each coefficient of the regression."""
FEWEST_ARRIVALS = 3
"""Fewest times that the output must arrive at the end of its range."""
CERTAIN = 5.0
"""Least number of standard errors by which the output must be predicted beyond the end."""
FEWEST_REPEATS, REPEATED = 10, 0.01
"""Fewest samples at the end of the range, and largest share of equal neighbours elsewhere, for
which exact repetition is not chance.
"""
REGRESSION_ROUNDING = 1e-6
"""Error of a regression, relative to the output, that counts as rounding and not as noise."""
STRONG = 0.05
"""Share of clipped samples above which nothing may be estimated."""


def held_share(signal: RealArray) -> float:
    """Share of samples at the largest value; 0 unless the signal was cut off there.

    It was cut off if it stays there for two samples or more and the line through the two samples
    before exceeds it by more than the converter's step.
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
    """Samples at which a signal reaches its largest value and then stays there."""
    return np.flatnonzero(~at_top[1:-2] & at_top[2:-1] & at_top[3:]) + 2


def clipping(record: RecordData) -> TestedAssumption:
    """Test whether outputs stay inside the range of their converters."""
    clean = unflagged(record)
    found = []
    for i, name in enumerate(record.outputs):
        for end, sign in (("largest", 1.0), ("least", -1.0)):
            signal = sign * clean.y[:, i]
            share = held_share(signal)
            if share and _would_exceed(clean, signal, i):
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
    return TestedAssumption("outputs stay inside their range", told, findings=tuple(found))


def _would_exceed(record: RecordData, signal: RealArray, output: int) -> bool:
    """Whether an output (N,) would exceed its largest value when it arrives there.

    Shorter regressions are used if longer ones have too few rows inside the range.
    """
    waits = [one.most or 0 for one in delays(record) if one.output == output]
    top, bottom = np.nanmax(signal), np.nanmin(signal)
    outside = ~np.isfinite(signal) | (signal == top)
    if held_share(-signal):
        outside |= signal == bottom
    at = np.arange(len(signal))
    # number of samples since the last arrival
    since = at - np.maximum.accumulate(np.where(outside, at, -1))
    arrivals = _arrivals(signal == top)
    noisy = _is_not_rounded(signal, outside) and np.sum(signal == top) >= FEWEST_REPEATS
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
        exact = REGRESSION_ROUNDING * float(np.std(signal[rows]))
        if noisy and noise > exact:
            return True
        away = _regressors(record, signal, here, past, waits) @ weight - top
        least = max(CERTAIN * noise / np.sqrt(len(away)), resolution(signal), exact)
        if away.mean() > least and (away > 0).mean() > 0.5:
            return True
    return False


def _is_not_rounded(signal: RealArray, outside: BoolArray) -> bool:
    """Whether the values of a signal (N,) inside its range are noisy, and not rounded.

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
