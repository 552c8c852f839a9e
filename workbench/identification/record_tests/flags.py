"""Flags: one value far outside all others that stands for "no value".

Loggers write -9999, 32767 or 0 if they have no value. A value that a signal really took has others
in between, or comes with a similar move of another channel.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.levels import evenly_chosen, runs, told_samples
from workbench.identification.record_tests.record import RecordData, once

CUSTOMARY = (
    0.0, 99.0, -99.0, 999.0, -999.0, 999.9, -999.9, 9999.0, -9999.0, 9999.9, -9999.9, 99999.0,
    -99999.0, 32767.0, -32768.0, 65535.0, 2147483647.0, -2147483648.0, 1e20, 1e30, -1e30, 1e35,
)  # fmt: skip
"""Values that loggers write for "no value"."""
FAR = 3.0
"""Least distance of a flag from the nearest other value, in units of the range of all others."""
FEWEST_VALUES = 5
"""Fewest different values among all others: a signal with few levels says nothing about
its range.
"""
CHANCE = 1e-3
"""A value counts as a flag if measured values would repeat exactly with less than this
probability.
"""
EVENTS = 50
"""Number of well separated occurrences at which another channel is examined."""
LAGS = 400
"""Number of samples around an occurrence in which another channel would show the same move."""
ANSWERED = 6.0
"""Mean of another channel around the occurrences, in standard errors, that is not chance."""
SHARED = 0.8
"""If two channels share this fraction of occurrences, whole rows are without values."""


@once
def flagged(record: RecordData) -> tuple[BoolArray, BoolArray]:
    """Masks of u (N, nu) and of y (N, ny), True at flags."""
    suspected: list[BoolArray] = [
        np.column_stack([_far_outside(column, record) for column in table.T])
        for table in (record.u, record.y)
    ]
    u_mask, y_mask = (np.zeros_like(mask) for mask in suspected)
    for i in np.flatnonzero(suspected[1].any(axis=0)):
        mask, column = suspected[1][:, i], record.y[:, i]
        others = record.u.T, suspected[0].T
        y_mask[:, i] = mask & _is_flag(mask, column, *others, after=False)
    for j in np.flatnonzero(suspected[0].any(axis=0)):
        mask, column = suspected[0][:, j], record.u[:, j]
        others = record.y.T, suspected[1].T
        u_mask[:, j] = mask & _is_flag(mask, column, *others, after=True)
    return u_mask, y_mask


@once
def unflagged(record: RecordData) -> RecordData:
    """The record without flags: in y they become missing; in u the previous value is held."""
    u_mask, y_mask = flagged(record)
    if not (u_mask.any() or y_mask.any()):
        return record
    u = record.u.copy()
    for j in np.flatnonzero(u_mask.any(axis=0)):
        kept = np.flatnonzero(~u_mask[:, j])
        before = np.maximum(np.searchsorted(kept, np.arange(len(u)), side="right") - 1, 0)
        u[:, j] = record.u[kept[before], j]
    rows = np.asarray(u_mask.any(axis=1))
    y = np.where(y_mask | rows[:, None], np.nan, record.y)
    return record.replaced(u, y)


def flags(record: RecordData) -> TestedAssumption:
    """Test whether some values stand for "no value"."""
    found = []
    for kind, table, names, masks in (
        ("input", record.u, record.inputs, flagged(record)[0]),
        ("output", record.y, record.outputs, flagged(record)[1]),
    ):
        for j in np.flatnonzero(masks.any(axis=0)):
            samples = np.flatnonzero(masks[:, j])
            values = ", ".join(f"{value:g}" for value in np.unique(table[samples, j]))
            remedy = (
                "give these samples of the output as NaN"
                if kind == "output"
                else "cut the record there, or give these samples as NaN"
            )
            found.append(
                Finding(
                    "flags",
                    f"{names[j]!r} is {values} in {samples.size} of {len(table)} samples, far "
                    "outside of all its other values: that stands for a missing value",
                    f"{kind} {names[j]!r}, {told_samples(samples)}",
                    samples.size / len(table),
                    "share of the samples",
                    f"{remedy} (`read_variables` reads a file as it is)",
                    forbids=True,
                )
            )
    result = "some values are flags" if found else "no value repeats far outside of the others"
    return TestedAssumption("every value was measured", result, findings=tuple(found))


def _far_outside(column: RealArray, record: RecordData) -> BoolArray:
    """Mask of samples where a channel (N,) takes an extreme value far from all others."""
    mask = np.zeros(len(column), dtype=bool)
    ends = np.nanmin(column), np.nanmax(column)
    at_end: list[BoolArray] = [np.asarray(column == end) for end in ends]
    known: BoolArray = np.isfinite(column)
    between = known & ~at_end[0] & ~at_end[1]
    for k, end in enumerate(ends):
        here = at_end[k]
        # The other extreme may be a flag itself, so the range is first computed without it.
        for rest in (between, known & ~here):
            if here.sum() < 2 or not rest.any():
                continue
            low, high = float(column[rest].min()), float(column[rest].max())
            gap = low - end if k == 0 else end - high
            if not (gap > FAR * (high - low) > 0):
                continue
            values, counts = np.unique(evenly_chosen(column[rest]), return_counts=True)
            if values.size < FEWEST_VALUES:
                continue
            alike = (counts.max() / counts.sum()) ** (int(here.sum()) - 1)
            if float(end) in CUSTOMARY or alike < CHANCE:
                mask |= here if end != 0 else _between_values(here, record)
                break
    return mask


def _between_values(here: BoolArray, record: RecordData) -> BoolArray:
    """A mask without stretches at an end of an experiment: 0 before something is switched on."""
    kept = here.copy()
    for piece in record.pieces():
        first, length = runs(here[piece])
        for a, n in zip(first, length, strict=True):
            if a == 0 or a + n == piece.stop - piece.start:
                kept[piece.start + a : piece.start + a + n] = False
    return kept


def _is_flag(
    mask: BoolArray, column: RealArray, others: RealArray, suspected: BoolArray, after: bool
) -> bool:
    """Whether no other channel (channels, N) moves with a channel at the masked samples.

    Other channels are examined ``after`` the samples, or before. Rows in which all channels have
    flags do not count as moves.
    """
    value = float(column[mask][0]) if mask.any() else 0.0
    for other, theirs in zip(others, suspected, strict=True):
        if theirs.any() and (mask & theirs).sum() >= SHARED * max(mask.sum(), theirs.sum()):
            if value == 0 or value not in CUSTOMARY:
                return False
        elif _moves_with(runs(mask)[0], other, after):
            return False
    return True


def _moves_with(events: IntegerArray, other: RealArray, after: bool) -> bool:
    """Whether a channel (N,) moves after the events, or before them, by more than chance."""
    apart = max(1, len(other) // EVENTS)
    events = events[np.unique(events // apart, return_index=True)[1]]
    lags = np.arange(min(LAGS, len(other) // 10))
    everywhere = np.linspace(0, len(other) - 1, 20 * EVENTS).astype(int)

    def moved(at: IntegerArray) -> RealArray:
        if after:
            places = np.clip(at[:, None] + lags, 0, len(other) - 1)
            return other[places] - other[np.maximum(at - 1, 0)][:, None]
        return other[np.clip(at[:, None] - lags, 0, len(other) - 1)]

    usual, here = moved(everywhere), moved(events)
    known = np.isfinite(here).sum(axis=0)
    count = np.maximum(np.isfinite(usual).sum(axis=0), 1)
    middle = np.nansum(usual, axis=0) / count
    size = np.sqrt(np.nansum((usual - middle) ** 2, axis=0) / count)
    away = np.abs(np.nansum(here - middle, axis=0))
    return bool((away > ANSWERED * size * np.sqrt(np.maximum(known, 1))).any())
