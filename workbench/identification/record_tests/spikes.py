"""Spikes: outputs that jump for one or two samples without a cause in the inputs, and return.

The response to the inputs, by an impulse response, is subtracted first, and then the median of five
samples. Heavy tails are not spikes: the bulk of the remainder determines its own tail.

Source: R. Pearson, "Outliers in process modeling and identification", IEEE Transactions on Control
Systems Technology 10(1), 2002 (the median filter).
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.record_tests.delay import explained, first_impulses, known_past
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.impulse import Impulse, gaps_filled
from workbench.identification.record_tests.levels import (
    evenly_chosen,
    resolution,
    told_samples,
)
from workbench.identification.record_tests.record import RecordData

BULK = (0.1, 0.03)
"""Shares of samples from whose sizes the tail is extrapolated."""
EXPECTED = 0.05
"""Expected number of samples, in the whole record, that the tail puts beyond the limit."""
LEAST = 1.0
"""Least size of a spike in standard deviations of the output; smaller ones are harmless."""
STEPS = 4.0
"""Least size of a spike in steps of the converter."""
RARE = 0.01
"""Largest share of samples that can be spikes; more frequent events belong to the signal."""
FEWEST = 100
"""Fewest samples of a record in which spikes are searched."""


def spikes(record: RecordData) -> TestedAssumption:
    """Test whether outputs have single samples that no input and no noise explains."""
    assumption = "outputs hold no spikes"
    clean = unflagged(record)
    if len(clean.y) < FEWEST:
        return TestedAssumption(assumption, f"{len(clean.y)} samples are too few", testable=False)
    found = []
    for i, response in enumerate(first_impulses(record)[0]):
        y, name = clean.y[:, i], record.outputs[i]
        signals = gaps_filled(y), gaps_filled(y) - explained(record)[:, i]
        own, left = (signal - median_of_five(signal) for signal in signals)
        # A spike shows both in the output itself and in its unexplained part.
        away = np.where(own * left > 0, np.minimum(np.abs(own), np.abs(left)), 0.0)
        away[~np.isfinite(y) | ~known_past(clean, response)] = 0.0
        away[_after_pulses(clean.u, response)] = 0.0
        size = float(np.std(evenly_chosen(y)))
        tail = min(tail_limit(np.abs(own)), tail_limit(np.abs(left)))
        limit = max(tail, LEAST * size, STEPS * resolution(y))
        samples = np.flatnonzero(away > limit)
        if not 0 < samples.size <= RARE * len(y):
            continue
        largest = samples[np.argsort(-away[samples])]
        found.append(
            Finding(
                "spikes",
                f"{samples.size} samples of {name!r} leave it for an instant, by up to "
                f"{away.max():.3g} where its standard deviation is {size:.3g}, and no "
                "input moved so",
                f"output {name!r}, {told_samples(np.sort(largest))}",
                float(away.max() / size),
                "size of the largest spike, in standard deviations of the output",
                "look at these samples, and give those that were not measured right as NaN",
            )
        )
    told = "some hold spikes" if found else "no sample stands out of its neighbours"
    return TestedAssumption(assumption, told, findings=tuple(found))


def _after_pulses(u: RealArray, response: Impulse | None) -> BoolArray:
    """Mask (N,) of samples where an output may respond to single pulses of the inputs."""
    reach = 1 if response is None else response.response.shape[1]
    answering = np.zeros(len(u), dtype=bool)
    for column in u.T:
        away = np.abs(column - median_of_five(column))
        limit = tail_limit(away)
        pulses = np.flatnonzero(away > (limit if np.isfinite(limit) else 0.0))
        if pulses.size <= RARE * len(u):
            answering[np.unique(np.minimum(pulses[:, None] + np.arange(reach), len(u) - 1))] = True
    return answering


def median_of_five(signal: RealArray) -> RealArray:
    """The median of each sample (N,) and its two neighbours on both sides."""
    a, b, c, d, e = (np.pad(signal, 2, "edge")[k : k + len(signal)] for k in range(5))
    low, high = np.minimum(a, b), np.maximum(a, b)
    other_low, other_high = np.minimum(d, e), np.maximum(d, e)
    # Among four values, the least and the largest cannot be the median, whatever the fifth is.
    inner, outer = np.maximum(low, other_low), np.minimum(high, other_high)
    return np.asarray(np.maximum(np.minimum(inner, outer), np.minimum(np.maximum(inner, outer), c)))


def tail_limit(sizes: RealArray) -> float:
    """Size that the tail, extrapolated from the bulk of sizes (N,), hardly ever exceeds.

    It is infinite if the bulk is 0, which says nothing.
    """
    near, far = np.quantile(evenly_chosen(sizes), [1 - share for share in BULK])
    if not near > 0:
        return np.inf
    heavy = np.log(far / near) / np.log(BULK[0] / BULK[1])
    return float(far * (BULK[1] * len(sizes) / EXPECTED) ** heavy)
