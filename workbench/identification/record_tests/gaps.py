"""Gaps and instants: missing samples, and uneven time stamps."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.levels import runs, told_samples
from workbench.identification.record_tests.record import RecordData

MANY = 0.02
"""Share of missing samples above which they are reported."""
UNEVEN = 0.1
"""Largest harmless distance of an instant from an even one, in steps."""
ROUNDED = 0.6
"""Largest such distance, in units of the stamps' last digit, that rounding explains."""
WHOLE = 0.1
"""Distance of a step from a multiple of the usual step, in usual steps, that counts as rounding."""
FEWEST_ROUNDED = 3
"""Fewest different steps from which rounding of the stamps is distinguished from missing rows."""


def complete_outputs(record: RecordData) -> TestedAssumption:
    """Test whether outputs were measured at all samples."""
    found, told = [], []
    for name, y in zip(record.outputs, record.y.T, strict=True):
        first, length = runs(np.isnan(y))
        count = int(length.sum())
        if not count:
            continue
        longest = int(length.max())
        told.append(f"{count} samples of {name!r} are missing")
        if count > MANY * len(y):
            at = int(first[np.argmax(length)])
            found.append(
                Finding(
                    "gaps",
                    f"{count} of {len(y)} samples of {name!r} are missing, up to {longest} in a "
                    "row",
                    f"output {name!r}, the longest gap from sample {at} on",
                    count / len(y),
                    "share of the samples that are missing",
                    "take a fit that bridges gaps, such as `StateSpaceFit`, or cut the record",
                )
            )
    return TestedAssumption(
        "outputs are complete", "; ".join(told) or "none is missing", findings=tuple(found)
    )


def instants(record: RecordData) -> TestedAssumption:
    """Test whether samples were taken at even instants."""
    assumption = "samples are even"
    if record.times is None:
        return TestedAssumption(assumption, "no instants were given", testable=False)
    worst, missing, rounded = 0.0, 0, ""
    places: list[int] = []
    for piece in record.pieces():
        times = record.times[piece] - record.times[piece.start]
        if len(times) < 3:
            continue
        steps, number = np.diff(times), np.arange(len(times))
        usual, digit = float(np.median(steps)), _last_digit(np.diff(times))
        turns = np.round(steps / usual)
        lost = (turns > 1) & (np.abs(steps - turns * usual) < WHOLE * usual)
        away = _distance_from_even(times, number)
        if np.abs(away).max() < ROUNDED * digit and not 0 < lost.sum() < FEWEST_ROUNDED:
            rounded = f"; they are rounded to {digit:.3g} s: give dt"
        elif lost.any():
            missing += int((turns[lost] - 1).sum())
            places += [piece.start + int(k) + 1 for k in np.flatnonzero(lost)]
            number = np.concatenate([[0], np.cumsum(np.where(lost, turns, 1))])
            away = _distance_from_even(times, number)
        far = float(np.abs(away).max()) / usual
        if far > UNEVEN and not rounded:
            places.append(piece.start + int(np.argmax(np.abs(away))))
        worst = max(worst, far)
    found = []
    if missing:
        found.append(
            Finding(
                "missing rows",
                f"{missing} rows are missing between the stamps, which the samples then deny",
                f"all channels, {told_samples(places)}",
                missing / len(record.times),
                "missing rows over those that are there",
                "cut the record there into experiments, or put rows of NaN where they are missing",
                forbids=True,
            )
        )
    elif worst > UNEVEN and not rounded:
        found.append(
            Finding(
                "uneven samples",
                f"samples lie up to {worst:.2g} steps from even instants",
                f"all channels, {told_samples(places)}",
                worst,
                "largest distance from an even instant, in steps",
                "resample the record to even instants, or cut it where the step changes",
                forbids=True,
            )
        )
    told = f"instants lie up to {worst:.2g} steps from even ones{rounded}"
    return TestedAssumption(assumption, told, findings=tuple(found))


def _distance_from_even(times: RealArray, number: Array) -> RealArray:
    """Distance of instants (N,) from the best-fitting even instants with these numbers."""
    line = np.polynomial.polynomial.polyfit(number, times, 1)
    return np.asarray(times - np.polynomial.polynomial.polyval(number, line))


def _last_digit(steps: RealArray) -> float:
    """The unit to which stamps were rounded, if a few different steps show it; otherwise 0."""
    usual = float(np.median(steps))
    different = np.unique(np.round(steps / usual, 6)) * usual
    return float(np.diff(different).min()) if 1 < different.size <= 4 else 0.0
