"""Delays: how long an output waits before it answers an input.

A slow start is no delay. The step response of n equal lags reaches in a time d about 2^-n of what
it reaches in 2 d, while d is short against the lags. So d counts as delay when less than `STARTED`
of that is there, for certain. Records are averaged over ever longer blocks until it is found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import oaconvolve

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.record_tests.finding import Finding, Tested
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.impulse import (
    Impulse,
    busiest,
    gaps_filled,
    impulse,
)
from workbench.identification.record_tests.record import RecordData, once

STARTED = 1 / 8
"""Share of the answer within 2 d that has come within d, at most, for d to be a delay."""
CERTAIN = 3.0
"""Standard deviations by which the answer within d may be larger than it was found."""
FOUND = 8.0
"""Standard deviations of the answer within 2 d that it must have at least."""
COARSER = 4
"""Factor between the lengths of blocks."""
FEWEST_BLOCKS, FEWEST_WAITED = 200, 4
"""Blocks of a record that are needed to look for a delay, and blocks of a delay."""
TOLD = 10
"""Delay [samples] from which on a model needs to know it."""


@dataclass(frozen=True)
class Delay:
    """A delay from an input to an output: at least and at most so many samples; None: not found.

    ``tested`` is whether the answer could be seen at all.
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
    """What impulse responses at full rate explain of the outputs (N, ny)."""
    u, made = unflagged(record).u, np.zeros(record.y.shape)
    for i, response in enumerate(first_impulses(record)[0]):
        if response is not None:
            for column, each in zip(u.T, response.response, strict=True):
                made[:, i] += oaconvolve(column - column.mean(), each)[: len(u)]
    return made


def known_past(record: RecordData, response: Impulse | None) -> BoolArray:
    """Where (N,) the inputs are known for as long as they act at full rate."""
    lags = 0 if response is None else response.response.shape[1]
    known = np.ones(len(record.u), dtype=bool)
    for piece in record.pieces():
        known[piece.start : piece.start + lags] = False
    return known


@once
def delays(record: RecordData) -> tuple[Delay, ...]:
    """The delay of each output behind each input."""
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
                    found[j, i] = _waited(response, found[j, i])
            size *= COARSER
            response = impulse(u, y, size) if len(u) >= FEWEST_BLOCKS * size else None
    return tuple(found[pair] for pair in sorted(found))


def _waited(response: Impulse, known: Delay) -> Delay:
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


def prompt_outputs(record: RecordData) -> Tested:
    """Whether outputs answer soon."""
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
                        'give the fit a delay of so many samples, or delay="estimate"; shift the '
                        "input for what takes no delay",
                    )
                )
    testable = any(one.tested for one in several)
    return Tested(assumption, "; ".join(told), testable=testable, findings=tuple(found))
