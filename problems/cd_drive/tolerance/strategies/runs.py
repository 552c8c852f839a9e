"""The experiment of section 8.6 and appendix A.3, and the values read from it.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from workbench.types import RealArray

from ...diagnosis.defect_runs import ROTATION
from ...diagnosis.quality import Quality
from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, Values, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.record import Record
from ..bench_reading import BenchReading
from ..scenario import Scenario, Stage

ENGAGED = 1.0
"""Time [s] at which the other strategy takes over from the reference strategy (appendix A.3)."""
AFTER = 5e-3
"""Time [s] after the scratch in which the largest error is the excursion."""
ANGLE = {"focus": 0.0, "radial": 0.2}
"""Angle [revolutions] at which the 1.2 mm scratch starts. In focus the disc is fastest there, so
eq. 8.1 is close to its worst case. In the radial loop the reference strategy would lose the track
at such an angle.
"""
LENGTH, MINOR = 1.2e-3, 0.4e-3
"""Lengths of the two scratches along the track [m]; the minor one is on the disc's other side."""
SCRATCHED = 0.3
"""Time [s] from which the scratches are present."""
FALSE = 0.6, 1e-3
"""Start and duration [s] of the first false detection; the second comes at the same angle."""
SCRATCH_WINDOW = (-1.5e-3, 6.5e-3)
"""Times [s] between which signals are shown, from the start of the 1.2 mm scratch."""
BINS = 500
"""Number of stretches of a whole run; the least and the largest value of each are shown."""


class StrategyOutcome(NamedTuple):
    """Excursion and periodic error [m]; how often focus or track was lost or regained.

    events: after the strategy has settled. early_events: before that, mostly while it takes over
    from the reference strategy.
    """

    excursion: float
    periodic: float
    events: int
    early_events: int


@dataclass(frozen=True)
class Experiment:
    """The experiment on one drive: first the reference strategy, then another.

    depth, displacement: of both scratches; the displacement is over the largest error that can be
    read. settling: number of revolutions in which the other strategy settles. revolutions: number
    of those after it, whose scratches are evaluated. length: of the larger scratch along the track
    [m]. reading: of what the text leaves open about the bench. quality: as in `Strategies`.
    """

    axis: Axis
    values: Values = "printed"
    depth: float = 0.7
    displacement: float = 0.5
    settling: int = 3
    revolutions: int = 3
    length: float = LENGTH
    reading: BenchReading = field(default_factory=BenchReading)
    quality: Quality = "graded"

    @property
    def first(self) -> float:
        """Start [s] of the first revolution in which the other strategy is evaluated."""
        return float(np.ceil(ENGAGED * ROTATION) + self.settling) / ROTATION

    @property
    def duration(self) -> float:
        return self.first + (self.revolutions + 0.25) / ROTATION

    @cached_property
    def disc(self) -> Disc:
        return Disc.along(self.axis, red_book(self.axis).deviation, rotation=ROTATION)

    def printed(self, seed: int) -> ScratchDraw:
        """The scratch of section 8.6, at which eq. 8.1 is close to its worst case."""
        return ScratchDraw(seed, ANGLE[self.axis])

    def scenario(
        self, drive: str, strategy: str, scratch: ScratchDraw, refine: int = 1, noisy: bool = True
    ) -> Scenario:
        """The experiment as a scenario; ``noisy``: with noise of diodes and electronics."""
        swing = scratch.sign * self.displacement * ACCEPTABLE_ERROR[self.axis]
        start, lasts = FALSE
        again = start + np.ceil((self.first - start) * ROTATION) / ROTATION
        return Scenario(
            self.reading.laboratory(self.axis, drive, self.values, noisy=noisy, refine=refine),
            self.disc,
            tuple(
                Defect(
                    length,
                    (scratch.angle + half) % 1.0,
                    self.depth,
                    displacement=swing,
                    edge=scratch.edge,
                    present=(SCRATCHED, np.inf),
                )
                for length, half in ((self.length, 0.0), (MINOR, 0.5))
            ),
            false_alarms=tuple((at, at + lasts) for at in (start, float(again))),
            stages=(Stage("reference"), Stage(strategy, ENGAGED)),
            quality=self.quality,
            duration=self.duration,
            seed=scratch.seed,
        )

    def outcome(self, record: Record, angle: float) -> StrategyOutcome:
        """Outcome of the strategy that took over, with the scratch at an angle [revolutions]."""
        error = record.x_cd - record.x
        turning = slice(*(round(t * RATE) for t in (self.first, self._last)))
        wave = np.exp(-2j * np.pi * ROTATION * record.time[turning])
        starts = self.starts(angle)
        evaluated = (starts > self.first - PERIOD) & (starts < self._last - PERIOD)
        excursion = max(
            float(abs(error[(record.time >= end) & (record.time <= end + AFTER)]).max())
            for end in starts[evaluated] + self.length / VELOCITY
        )
        periodic = 2.0 * abs(np.mean(error[turning] * wave))
        late = sum(event.time >= self.first for event in record.events)
        return StrategyOutcome(excursion, float(periodic), late, len(record.events) - late)

    @property
    def _last(self) -> float:
        return self.first + self.revolutions / ROTATION

    def starts(self, angle: float) -> Any:
        """Times [s] at which the larger scratch begins, if `AFTER` ends within the record."""
        times = (np.arange(np.ceil(self.duration * ROTATION)) + angle) / ROTATION
        late = self.duration - self.length / VELOCITY - 2 * AFTER
        return times[(times > SCRATCHED) & (times < late)]

    def windows(self) -> dict[str, slice]:
        """Samples around the printed scratch, before and after the other strategy takes over."""
        starts = self.starts(ANGLE[self.axis])
        chosen = {"before": starts[starts < ENGAGED][-1], "after": starts[starts > self.first][0]}
        return {
            name: slice(
                round((at + SCRATCH_WINDOW[0]) * RATE), round((at + SCRATCH_WINDOW[1]) * RATE)
            )
            for name, at in chosen.items()
        }

    @property
    def window_times(self) -> RealArray:
        """Times [ms] of a window, from the start of the scratch."""
        window = next(iter(self.windows().values()))
        return 1e3 * (SCRATCH_WINDOW[0] + np.arange(window.stop - window.start) / RATE)


def envelope(values: RealArray) -> tuple[RealArray, RealArray]:
    """Least and largest values (2, BINS) of BINS stretches of (N,), and the ends [s] of the
    stretches.
    """
    edges = np.linspace(0, len(values), BINS + 1).astype(int)
    found = np.array(
        [np.minimum.reduceat(values, edges[:-1]), np.maximum.reduceat(values, edges[:-1])]
    )
    return found.astype(np.float32), edges[1:] / RATE
