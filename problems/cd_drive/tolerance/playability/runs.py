"""Strategies with their parameters, run in circumstances and scored by the true error.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, UnknownNameError
from workbench.executor import Progress, Threads, spread
from workbench.simulation import Cascade, discrete_system
from workbench.simulation.ensemble_scores import error_scores

from ...diagnosis.position_estimator.trials import DIST_MAX, DIST_MIN
from ...diagnosis.quality import diode_quality
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

SCORED_FROM = 0.4
"""Time [s] from which a run is scored; loop and repetitive control have settled by then."""
REPAIRED = 2.5e-3
"""Longest burst [m of track] that the error correction repairs (section 2.5.1)."""
SCORE_UNITS = {"out": "1", "losses": "1", "burst": "m", "deviation": "m"}
"""Scores of a run and their units: share of time out of spec; number of losses of focus or track;
longest stretch out of spec along the track; rms of the true error.
"""
SCORES = tuple(SCORE_UNITS)


@dataclass(frozen=True)
class Design:
    """A strategy and its parameters.

    Parameters
    ----------
    strategy
        Name in `STRATEGIES`.
    gain_db
        Gain of its controllers over the reference controllers [dB].
    dist_max
        Value of the quality's argument (eq. 7.13) from which on no measurement is believed.
    corner
        Corner of the repetitive control's low-pass [Hz], where the strategy has one.
    replacement
        Discrete K' of the strategy that switches to it; see `Strategies`.

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
        """Make the strategy for a clean level of 1 V and a loop gain off by ``gain_db``."""
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
        """``made`` with a detector for a clean disc's ``level`` [V] and this design's dist_max."""
        eye = diode_quality(level, DIST_MIN, self.dist_max)
        parts = [
            replace(one, controller=eye) if one.name == "detector" else one for one in made.parts
        ]
        return Cascade(made.measurements, parts, previous=made.previous)


@dataclass(frozen=True)
class Player:
    """Scores of designs on several drives in one circumstance, as a task for an executor."""

    designs: tuple[Design, ...]
    drives: tuple[str, ...]
    duration: float

    def __post_init__(self) -> None:
        if not self.designs or not self.drives:
            raise InputError("need one design and one drive at least")
        if not SCORED_FROM < self.duration < np.inf:
            raise InputError(f"duration is {self.duration} s; it must be above {SCORED_FROM} s")

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
    """Run a task for every circumstance in threads: (designs, drives, circumstances, SCORES).

    ``task`` returns (drives, designs, SCORES) for one circumstance. The compiled loop does not
    block other threads, and all threads share the compiled code.
    """
    with Threads(workers=workers) as pool:
        return np.transpose(
            spread(task, many, pool, progress=progress, description=what), (2, 1, 0, 3)
        )


def played(
    one: Circumstance,
    drive: str,
    design: Design,
    duration: float,
    made: Cascade | None = None,
    refine: int = 1,
) -> Record:
    """Run one design; ``made`` is its strategy, if it was made before."""
    bench = Laboratory(one.axis, drive, refine=refine)
    if made is None:
        made = design.made(one.axis, one.believed, one.gain_db)
    return bench.closed_loop(
        design.seeing(made, clean_level(bench, one.disc.reflectivity)),
        one.excitation(bench, duration),
        disc=one.disc,
        defects=one.defects,
        seed=one.noise_seed(drive),
    )


def evaluated(record: Record) -> RealArray:
    """The true error [m] from SCORED_FROM on."""
    error: RealArray = (record.x_cd - record.x)[round(SCORED_FROM * RATE) :]
    return error


def scored(error: RealArray, axis: Axis) -> Sequence[float]:
    """The SCORES of a true error [m] (N,)."""
    found = error_scores(error, ACCEPTABLE_ERROR[axis], CAPTURE[axis])
    return found.outside, found.losses, float(found.longest) / RATE * VELOCITY, found.rms


@lru_cache(maxsize=256)
def sampled_controller(axis: Axis, gain_db: float = 0.0) -> StateSpace:
    """Discrete controller K of eq. 6.12 with its gain changed by ``gain_db``."""
    return 10.0 ** (gain_db / 20.0) * discrete_system(controller(axis), PERIOD)


def chosen(count: int) -> tuple[str, ...]:
    """Names of ``count`` of the twelve drives, evenly spread."""
    return tuple(f"CD{1 + n * 12 // count}" for n in range(count))
