"""What must hold of `cd/playability`: traces, replays, means, intervals, margins.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from workbench import Check
from workbench.heavy_types import Dataset

from ...drive.disc import VELOCITY
from ...drive.plants import controller, responses
from ...drive.red_book import ACCEPTABLE_ERROR, AXES
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ..ensemble import GROUPS, Circumstance
from .runs import Design, evaluated, played
from .search import BOUNDS, LARGEST, PARAMETERS


def checks_of(
    answer: Dataset,
    first: Mapping[Axis, Circumstance],
    duration: float,
    designs: Mapping[Axis, Sequence[Design]],
) -> list[Check]:
    """Checks of an answer; the first circumstance of each axis is replayed with its designs."""
    idle = answer["burst"].where(answer["out"] == 0.0, 0.0)
    low, high = (answer["balloon_interval"].sel(end=end) for end in ("low", "high"))
    outside = np.maximum(low - answer["balloon"], 0.0) + np.maximum(answer["balloon"] - high, 0.0)
    least, most = (np.array([BOUNDS[name][k] for name in PARAMETERS]) for k in (0, 1))
    best = answer["best"].values
    worse = float((answer["cost"].min("trial") - answer["cost"].isel(trial=0)).max())
    peaks = [continuous_peak(axis, float(best[n, 0])) for n, axis in enumerate(AXES)]
    replay = _replay_off(answer, first, duration, designs)
    return [
        Check("stored traces", "score off what the trace says", _trace_off(answer), 1e-6),
        Check("replay", "relative change of the rms error at half the step", replay, 0.02),
        Check("arms", "off the mean of the stored runs", _arms_off(answer), 1e-6),
        Check("bursts", "longest burst of a run never out of spec [m]", float(idle.max()), 0.0),
        Check("intervals", "size of a balloon outside its interval", float(outside.max()), 0.05),
        Check("training", "cost of the tuned less that of the untuned", worse, 0.0),
        Check("margin", "largest |S| of a continuous loop, tuned", max(peaks), 1.05 * LARGEST),
        Check(
            "bounds",
            "parameters outside of theirs",
            float(((best < least - 1e-9) | (best > most + 1e-9)).sum()),
            0.0,
        ),
    ]


def continuous_peak(axis: Axis, gain_db: float) -> float:
    """Largest |S| of the twelve drives: eq. 3.18 and 6.12, hold and delay being 1.5 samples."""
    frequency = np.geomspace(20.0, 15e3, 997)
    s = 2j * np.pi * frequency
    K = 10.0 ** (gain_db / 20.0) * controller(axis)(s)
    L = K * responses(axis, frequency) * np.exp(-1.5 * s * PERIOD)
    return float((1.0 / abs(1.0 + L)).max())


def _trace_off(answer: Dataset) -> float:
    """Share of time out of spec and burst from the stored error, sample by sample."""
    off = 0.0
    for axis in AXES:
        error = answer["trace"].sel(axis=axis).values
        longest = run = beyond = 0
        for value in error:
            run = run + 1 if abs(float(value)) > ACCEPTABLE_ERROR[axis] else 0
            longest, beyond = max(longest, run), beyond + (run > 0)
        own = answer.sel(axis=axis).isel(strategy=0, drive=0, circumstance=-1)
        off = max(off, abs(beyond / len(error) - float(own["out"])))
        off = max(off, abs(longest * VELOCITY / RATE - float(own["burst"])))
    return off


def _replay_off(
    answer: Dataset,
    first: Mapping[Axis, Circumstance],
    duration: float,
    designs: Mapping[Axis, Sequence[Design]],
) -> float:
    """The first scenario of each strategy that kept its track, with the optics at half the step."""
    off = 0.0
    for axis, one in first.items():
        for design in designs[axis]:
            own = answer.sel(axis=axis, strategy=design.strategy)
            stored = own.isel(drive=0, circumstance=0)
            if float(stored["losses"]) > 0.0:  # what is lost is chaotic
                continue
            drive = str(stored["drive"].values)
            error = evaluated(played(one, drive, design, duration, refine=2))
            off = max(
                off, abs(float(np.sqrt(np.mean(error**2))) / float(stored["deviation"]) - 1.0)
            )
    return off


def _arms_off(answer: Dataset) -> float:
    """Arms against plain means over drives and the group's circumstances."""
    off = 0.0
    for k, name in enumerate(answer["known"].values):
        own = answer["out"].isel(circumstance=slice(GROUPS.index(str(name)), None, len(GROUPS)))
        apart = abs(own.mean(["drive", "circumstance"]) - answer["arm"].isel(known=k))
        off = max(off, float(apart.max()))
    return off
