"""Stuck samples: an output that holds one value while its input moves, and then jumps.

A converter with coarse steps holds values too, but leaves them by a step or two; a slow sensor
holds every value equally long.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.record_tests.delay import explained, first_impulses, known_past
from workbench.identification.record_tests.finding import Finding, TestedAssumption
from workbench.identification.record_tests.flags import unflagged
from workbench.identification.record_tests.levels import resolution, robust_spread
from workbench.identification.record_tests.record import RecordData

LONGER = 10
"""Least ratio of a stuck run's length to that of nearly all others."""
SHORTEST, SHORTEST_OF_STEPS = 5, 20
"""Least length [samples] of a stuck run, without and with a converter that makes values equal."""
FEWEST_RUNS = 20
"""Fewest runs of an experiment that determine the usual length."""
JUMP = 4.0
"""Least jump of a stuck output at its end, in steps of the converter."""
EXPECTED = 0.5
"""Least movement that the inputs cause meanwhile, in spreads of the output."""
EXPLAINED = 0.4
"""Largest standard deviation of the unexplained output, relative to the output's."""
OVER_WRONG = 3.0
"""Least movement, in standard deviations of the unexplained output."""


def stuck(record: RecordData) -> TestedAssumption:
    """Test whether outputs move when inputs move."""
    clean = unflagged(record)
    found = []
    for i, name in enumerate(record.outputs):
        y, response = clean.y[:, i], first_impulses(record)[0][i]
        known = known_past(clean, response)
        held = _stuck_runs(clean, y, explained(record)[:, i], known)
        if not held:
            continue
        count = sum(n for _, n in held)
        places = ", ".join(f"{a} to {a + n - 1}" for a, n in held[:3])
        found.append(
            Finding(
                "stuck",
                f"{name!r} holds one value for up to {max(n for _, n in held)} samples while the "
                "inputs move",
                f"output {name!r}, samples {places}{', ...' if len(held) > 3 else ''}",
                count / len(y),
                "share of the samples that are stuck",
                "look at the sensor there, and give these samples as NaN",
            )
        )
    told = "some are stuck" if found else "no output holds a value while inputs move"
    return TestedAssumption("sensors follow", told, findings=tuple(found))


def _stuck_runs(
    record: RecordData, y: RealArray, made: RealArray, known: BoolArray
) -> list[tuple[int, int]]:
    """First sample and length of each run in which an output (N,) is stuck.

    ``made`` is the response to the inputs, ``known`` the mask of samples at which they are known
    long enough.
    """
    ends, step = (np.nanmin(y), np.nanmax(y)), resolution(y)
    wrong = float(np.nanstd((y - made)[known])) if known.any() else np.inf
    if not wrong < EXPLAINED * float(np.nanstd(y)):
        return []  # the response to the inputs is known at too few samples
    expected = max(EXPECTED * robust_spread(y), JUMP * step, OVER_WRONG * wrong)
    found = []
    for piece in record.pieces():
        part = y[piece]
        first, length = _runs_of_equals(part)
        if length.size < FEWEST_RUNS:
            continue
        usual = float(np.quantile(length, 0.99))
        least = max(SHORTEST_OF_STEPS if step else SHORTEST, LONGER * (usual - 1))
        for a, n in zip(*(each[length >= least] for each in (first, length)), strict=True):
            run = slice(piece.start + a, piece.start + a + n)
            if not known[run.start] or not np.isfinite(part[a]) or part[a] in ends:
                continue
            jump = abs(part[a + n] - part[a]) if a + n < len(part) else np.inf
            if jump >= JUMP * step and np.ptp(made[run]) >= expected:
                found.append((run.start, int(n)))
    return found


def _runs_of_equals(part: RealArray) -> tuple[RealArray, RealArray]:
    """First sample and length of each run of equal values; a single sample is a run of one."""
    changes: BoolArray = part[1:] != part[:-1]
    first = np.concatenate([[0], np.flatnonzero(changes) + 1])
    return first, np.diff(np.append(first, len(part)))
