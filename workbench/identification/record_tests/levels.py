"""Sizes of channels that no outlier moves, resolution of converters, and words for samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray

LOOKED_AT = 100_000
"""Samples, evenly taken from the whole record, from which the spread of a channel is found."""
GRID_ROUNDING = 0.05
"""Distance from a multiple of the step, in steps, that is rounding of a converter's values."""
MOST_DIGITS = 1e-12
"""Step of a channel, relative to its largest value, below which it is rounding of numbers."""
FEWEST_REPEATS = 2.0
"""Times that a value of a converter occurs at least, on average."""
NAMED = 6
"""Samples that a finding names."""


def evenly_chosen(column: RealArray, most: int = LOOKED_AT) -> RealArray:
    """At most so many measured samples of a channel (N,), evenly taken."""
    known = column[:: max(1, -(-len(column) // most))]
    return known[np.isfinite(known)]


def robust_spread(column: RealArray) -> float:
    """Spread of a channel that outliers do not move, its standard deviation if it is normal.

    Half the distance between the quantiles of 16 and 84 %; where a channel rests more often than
    that, the standard deviation.
    """
    known = evenly_chosen(column)
    if not known.size:
        return 0.0
    low, high = np.quantile(known, (0.16, 0.84))
    return float(high - low) / 2 or float(np.std(known))


def resolution(column: RealArray) -> float:
    """Step of the converter that a channel came from; 0 where its values show none."""
    known = evenly_chosen(column)
    values = np.unique(known)
    if values.size < 2 or known.size < FEWEST_REPEATS * values.size:
        return 0.0
    rises = np.diff(values)
    least = float(rises.min())
    if least < MOST_DIGITS * float(np.abs(values).max()):
        return 0.0  # rounding of computed numbers
    step = float((values[-1] - values[0]) / np.round(rises / least).sum())
    turns = rises / step
    return step if np.abs(turns - np.round(turns)).max() < GRID_ROUNDING else 0.0


def told_samples(samples: Sequence[int] | IntegerArray) -> str:
    """Numbers of samples in words: the first few."""
    named = ", ".join(str(int(k)) for k in samples[:NAMED])
    word = "sample" if len(samples) == 1 else "samples"
    return f"{word} {named}" + (", ..." if len(samples) > NAMED else "")


def runs(held: BoolArray) -> tuple[IntegerArray, IntegerArray]:
    """First sample and length of each run of True in a mask (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]
