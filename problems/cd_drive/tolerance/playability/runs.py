"""Strategies with their parameters, run through circumstances and scored by the true error.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import InputError, UnknownNameError
from workbench.executor import Progress, Threads, spread
from workbench.heavy_types import StateSpace
from workbench.simulation import Cascade, in_discrete_time
from workbench.simulation.machine import machine

from ...diagnosis.position_estimator.trials import DIST_MAX, DIST_MIN
from ...diagnosis.quality import quality_signal
from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ..ensemble import Circumstance
from ..tactics import CORNER, STRATEGIES, Strategies, clean_level

SETTLING = 0.4
"""From when on a run is scored [s]: disc and loop have settled, repetitive control has learnt."""
REPAIRED = 2.5e-3
"""Burst that the error correction repairs, along the track [m] (section 2.5.1)."""
SCORES = ("out", "losses", "burst", "deviation")
"""Of a run: share of time out of spec; how often focus, or the track, was lost; longest stretch out
of spec [m of track]; rms of the true error [m]."""


@dataclass(frozen=True)
class Design:
    """A strategy and its parameters.

    gain_db   of its controllers over the reference ones [dB];
    dist_max  of the quality signal (eq. 7.13), from which on nothing is believed;
    corner    of the repetitive control's low-pass [Hz], where the strategy has one;
    replacement  K', discrete, of the strategy that switches to it; see `Strategies`.

    Raises UnknownNameError for a strategy that is none, InputError for a dist_max that is not above
    the dist_min that the noise allows.
    """

    strategy: str
    gain_db: float = 0.0
    dist_max: float = DIST_MAX
    corner: float = CORNER
    replacement: StateSpace | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.strategy not in STRATEGIES:
            raise UnknownNameError("strategy", self.strategy, STRATEGIES)
        if not DIST_MIN < self.dist_max < np.inf:
            raise InputError(f"dist_max is {self.dist_max}; it must be above {DIST_MIN}, finite")

    def made(self, axis: Axis, rotation: float, gain_db: float) -> Cascade:
        """The strategy for a loop whose gain is off by `gain_db`, for a clean level of 1 V."""
        total_db = self.gain_db + gain_db
        other = self.replacement
        strategies = Strategies(
            axis,
            1.0,
            rotation,
            K=sampled_controller(axis, total_db),
            replacement=None if other is None else 10.0 ** (total_db / 20.0) * other,
            corner=self.corner,
        )
        return strategies.named(self.strategy)

    def seeing(self, made: Cascade, level: float) -> Cascade:
        """The same with the detector of a clean disc's level [V] and of this dist_max."""
        eye = quality_signal(level, DIST_MIN, self.dist_max)
        parts = [
            replace(one, controller=eye) if one.name == "detector" else one for one in made.parts
        ]
        return Cascade(made.measurements, parts, made.previous)


@dataclass(frozen=True)
class Player:
    """What one circumstance does to designs on several drives: a task for an executor."""

    designs: tuple[Design, ...]
    drives: tuple[str, ...]
    duration: float

    def __post_init__(self) -> None:
        if not self.designs or not self.drives:
            raise InputError("need one design and one drive at least")
        if not SETTLING < self.duration < np.inf:
            raise InputError(f"duration is {self.duration} s; it must be above {SETTLING} s")

    def __call__(self, one: Circumstance) -> RealArray:
        """Scores (drives, designs, SCORES)."""
        made = [design.made(one.axis, one.believed, one.gain_db) for design in self.designs]
        scores = np.zeros((len(self.drives), len(self.designs), len(SCORES)))
        for d, drive in enumerate(self.drives):
            for s, (design, cascade) in enumerate(zip(self.designs, made, strict=True)):
                record = played(one, drive, design, self.duration, cascade)
                scores[d, s] = scored(evaluated(record), one.axis)
        return scores


def met(
    task: Callable[[Circumstance], RealArray],
    many: Sequence[Circumstance],
    workers: int,
    progress: Progress,
    what: str,
) -> RealArray:
    """What a task makes of each circumstance, (drives, designs, SCORES), in threads.

    As (designs, drives, circumstances, SCORES). The compiled loop lets other threads run, and a
    thread shares what is compiled.
    """
    machine()  # threads that meet it at one time would each compile it
    with Threads(workers) as pool:
        return np.transpose(spread(task, many, pool, progress, what), (2, 1, 0, 3))


def played(
    one: Circumstance,
    drive: str,
    design: Design,
    duration: float,
    made: Cascade | None = None,
    refine: int = 1,
) -> Record:
    """A run of one design; `made`: its strategy, where it was made before."""
    bench = Laboratory(one.axis, drive, refine=refine)
    if made is None:
        made = design.made(one.axis, one.believed, one.gain_db)
    return bench.closed_loop(
        design.seeing(made, clean_level(bench, one.disc.reflectivity)),
        one.excitation(bench, duration),
        disc=one.disc,
        defects=one.defects,
        seed=one.seed,
    )


def evaluated(record: Record) -> RealArray:
    """The true error [m] from SETTLING on."""
    error: RealArray = (record.x_cd - record.x)[round(SETTLING * RATE) :]
    return error


def scored(error: RealArray, axis: Axis) -> Sequence[float]:
    """SCORES of a true error [m] (N,)."""
    size = abs(error)
    out = size > ACCEPTABLE_ERROR[axis]
    lost = np.diff((size > CAPTURE[axis]).astype(int), prepend=0) > 0
    edges = np.flatnonzero(np.diff(out.astype(int), prepend=0, append=0))
    longest = np.max(edges[1::2] - edges[::2], initial=0)
    rms = np.sqrt(np.mean(np.minimum(size, CAPTURE[axis]) ** 2))
    return float(out.mean()), float(lost.sum()), float(longest) / RATE * VELOCITY, float(rms)


@lru_cache(maxsize=256)
def sampled_controller(axis: Axis, gain_db: float = 0.0) -> StateSpace:
    """K of eq. 6.12, discrete, with its gain changed."""
    return 10.0 ** (gain_db / 20.0) * in_discrete_time(controller(axis), PERIOD)


def chosen(count: int) -> tuple[str, ...]:
    """So many of the twelve drives, evenly spread."""
    return tuple(f"CD{1 + n * 12 // count}" for n in range(count))
