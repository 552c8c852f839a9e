"""Delays: the time before an output responds to an input.

A slow start is not a delay. As long as d is short compared with the lags, the step response of n
equal lags at time d is about 2^-n of that at 2 d. So d counts as a delay if, with certainty, less
than `STARTED` of the response at 2 d has arrived by d. Records are averaged over longer and longer
blocks until a delay is found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import oaconvolve

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.impulse import (
    Impulse,
    busiest,
    gaps_filled,
    impulse,
)
from workbench.identification.record_tests.record import RecordData, once

STARTED = 1 / 8
"""For d to be a delay, at most this share of the response within 2 d may arrive within d."""
CERTAIN = 3.0
"""Number of standard deviations that are added to the response within d, for certainty."""
FOUND = 8.0
"""Least response within 2 d, in standard deviations."""
COARSER = 4
"""Factor between successive lengths of blocks."""
FEWEST_BLOCKS, FEWEST_WAITED = 200, 4
"""Fewest blocks in a record, and fewest blocks in a delay, for the search."""
TOLD = 10
"""Delay [samples] from which a model needs to know it."""


@dataclass(frozen=True)
class Delay:
    """Lower and upper bound of a delay from input to output [samples]; None: not found.

    ``tested`` is whether the response could be seen at all.
    """

    input: int
    output: int
    least: int | None
    most: int | None
    tested: bool


@once
def first_impulses(record: RecordData) -> tuple[tuple[Impulse | None, ...], slice]:
    """Impulse responses to each output at full rate, and the samples they were found in."""
    clean = unflagged(record)
    part = busiest(clean)
    return tuple(impulse(clean.u[part], gaps_filled(y)) for y in clean.y[part].T), part


@once
def explained(record: RecordData) -> RealArray:
    """Outputs (N, ny) as explained by impulse responses at full rate."""
    u, made = unflagged(record).u, np.zeros(record.y.shape)
    for i, response in enumerate(first_impulses(record)[0]):
        if response is not None:
            for column, each in zip(u.T, response.response, strict=True):
                made[:, i] += oaconvolve(column - column.mean(), each)[: len(u)]
    return made


def known_past(record: RecordData, response: Impulse | None) -> BoolArray:
    """Mask (N,) of samples before which the inputs are known for the whole impulse response."""
    lags = 0 if response is None else response.response.shape[1]
    known = np.ones(len(record.u), dtype=bool)
    for piece in record.pieces():
        known[piece.start : piece.start + lags] = False
    return known


@once
def delays(record: RecordData) -> tuple[Delay, ...]:
    """The delay from each input to each output."""
    clean = unflagged(record)
    first, part = first_impulses(record)
    u = clean.u[part]
    found: dict[tuple[int, int], Delay] = {}
    for i, at_once in enumerate(first):
        y, size, response = gaps_filled(clean.y[part, i]), 1, at_once
        found |= {(j, i): Delay(j, i, None, None, False) for j in range(u.shape[1])}
        while response is not None:
            for j in range(u.shape[1]):
                if found[j, i].least is None:
                    found[j, i] = _delay_in_response(response, found[j, i])
            size *= COARSER
            response = impulse(u, y, size) if len(u) >= FEWEST_BLOCKS * size else None
    return tuple(found[pair] for pair in sorted(found))


def _delay_in_response(response: Impulse, known: Delay) -> Delay:
    """A delay, if an impulse response shows one within its lags."""
    lags, size = response.response.shape[1], response.block
    own = slice(known.input * lags, (known.input + 1) * lags)
    spread = np.cumsum(np.cumsum(response.covariance[own, own], axis=0), axis=1)
    deviation = np.sqrt(np.maximum(np.diag(spread), 0.0))
    step = np.cumsum(response.response[known.input])
    started = np.maximum.accumulate(np.abs(step) + CERTAIN * deviation)
    wait = np.arange(1 if size == 1 else FEWEST_WAITED, lags)
    double = np.minimum(2 * wait, lags) - 1
    before, later = started[wait - 1], np.abs(step[double])
    seen = later > FOUND * deviation[double]
    late = wait[seen & (before < STARTED * later)]
    if not late.size:
        return replace(known, tested=known.tested or bool(seen.any()))
    last = int(late[-1])
    around = 0 if size == 1 else size
    return replace(known, least=last * size - around, most=last * size + around, tested=True)


def prompt_outputs(record: RecordData) -> TestedAssumption:
    """Test whether outputs respond soon."""
    assumption = "outputs answer inputs within few samples"
    found, told = [], []
    several = delays(record)
    for one in several:
        pair = f"{record.outputs[one.output]!r} behind {record.inputs[one.input]!r}"
        if not one.tested:
            told.append(f"{pair}: no answer is seen")
        elif one.least is None or one.most is None:
            told.append(f"{pair}: no delay is certain")
        else:
            span = f"{one.least}" if one.least == one.most else f"{one.least} to {one.most}"
            told.append(f"{pair}: {span} samples")
            if one.least >= TOLD:
                seconds = one.most * record.sample_time
                found.append(
                    Finding(
                        "delay",
                        f"{record.outputs[one.output]!r} answers {record.inputs[one.input]!r} "
                        f"after {span} samples (about {seconds:.3g} s)",
                        f"from input {record.inputs[one.input]!r} to output "
                        f"{record.outputs[one.output]!r}",
                        float(one.most),
                        "delay in samples",
                        'give the fit delay_samples="estimate", or so many, one less with '
                        "direct=False; shift the input for what takes no delay",
                    )
                )
    testable = any(one.tested for one in several)
    return TestedAssumption(assumption, "; ".join(told), testable=testable, findings=tuple(found))
