"""Robust sizes of channels, resolution of converters, and lists of samples in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import BoolArray, IntegerArray, RealArray

LOOKED_AT = 100_000
"""Number of samples, evenly spaced over the record, from which the spread of a channel
is computed.
"""
GRID_ROUNDING = 0.05
"""Distance from a multiple of the step, in steps, that counts as rounding."""
MOST_DIGITS = 1e-12
"""A step below this, relative to the channel's largest value, counts as rounding of numbers."""
FEWEST_REPEATS = 2.0
"""Least average number of times that each value of a converter occurs."""
NAMED = 6
"""Most samples that a finding lists."""


def evenly_chosen(column: RealArray, most: int = LOOKED_AT) -> RealArray:
    """At most ``most`` measured samples of a channel (N,), evenly spaced."""
    known = column[:: max(1, -(-len(column) // most))]
    return known[np.isfinite(known)]


def robust_spread(column: RealArray) -> float:
    """Spread of a channel, insensitive to outliers; the standard deviation for normal values.

    Half the distance between the 16 % and 84 % quantiles; if a channel rests so often that this is
    zero, the standard deviation.
    """
    known = evenly_chosen(column)
    if not known.size:
        return 0.0
    low, high = np.quantile(known, (0.16, 0.84))
    return float(high - low) / 2 or float(np.std(known))


def resolution(column: RealArray) -> float:
    """Step of a channel's converter; 0 if its values show none."""
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
    """Numbers of samples as text: the first few."""
    named = ", ".join(str(int(k)) for k in samples[:NAMED])
    word = "sample" if len(samples) == 1 else "samples"
    return f"{word} {named}" + (", ..." if len(samples) > NAMED else "")


def runs(held: BoolArray) -> tuple[IntegerArray, IntegerArray]:
    """First sample and length of each run of True in a mask (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], held, [False]]).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]
