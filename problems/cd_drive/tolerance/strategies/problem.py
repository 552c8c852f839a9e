"""Fault-tolerant strategies compared (sections 8.2-8.6, figures 8.7-8.9, A.1-A.6).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Run, problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.synthesis import discretise
from workbench.types import DataArray, StateSpace

from ...diagnosis.defect_runs import ROTATION
from ...diagnosis.quality import Quality
from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.plants import Gain
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values, drives
from ...laboratory.bench_setup import PERIOD
from ...laboratory.printed_noise import Amplitude, Fixed
from ...laboratory.record import Record
from ..bench_reading import BenchReading
from ..fault_filters import chosen_filter, needs_with_filter
from ..tactics import STRATEGIES, Strategies
from .claims import CLAIMED, LEVELS, claims_table, error_tables, over_reference, unmet
from .figures import strategy_figures
from .runs import LENGTH, Experiment, StrategyOutcome, envelope
from .stability import estimated_decay, repetitive_level

SHOWN = ("u", "f_en", "error", "w_Q")
"""Signals that are stored around a scratch."""
WIDE = ("u", "f_en")
"""Signals that are stored over a whole run."""
PERIODIC_SHARE = 0.1
"""Largest accepted periodic error of strategies A and B, over that of the reference strategy."""
PERIODIC_DIFFERENCE = 0.1
"""Largest accepted difference between the periodic errors of strategy C and of the reference
strategy, relative; their open loops are the same (section 8.6).
"""
HALF_STEP_CHANGE = 0.05
"""Largest accepted change of an excursion when the step of the simulation is halved, relative."""

Filter = Literal["high-pass", "robust", "with margins"]


def needs(axis: str, fault_filter: Filter = "high-pass", **_: Any) -> dict[str, Any]:
    """References to K', and to the designed fault filter if it is asked for."""
    return needs_with_filter(axis, fault_filter)


@problem(
    "cd/{axis}/strategies",
    axis=("focus", "radial"),
    needs=needs,
    data=(*TABLES, "data/red_book.csv"),
    added=("gain", "delay", "noise", "noise_fixed", "quality", "length"),
)
def strategies(
    axis: Axis,
    slower: Run,
    designed: Run | None = None,
    depth: Annotated[float, Field(ge=0.6, le=0.9)] = 0.7,
    displacement: Annotated[float, Field(ge=0, le=1)] = 0.5,
    drive_count: Annotated[int, Field(ge=0, le=12)] = 12,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    values: Values = "printed",
    fault_filter: Filter = "high-pass",
    gain: Gain = "own",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
    quality: Quality = "graded",
    length: Annotated[float, Field(gt=0, le=2.5e-3)] = LENGTH,
) -> StrategiesStudy:
    """Strategies against surface defects (figures 8.7-8.9, A.1-A.6).

    A disc of the largest deviation, 500 um in focus and 70 um radially, turns at 5.5 Hz with a
    scratch of 1.2 mm, a minor scratch and a false detection. For a second the reference strategy is
    in charge, which sets the error to zero by the quality signal. Then another strategy takes over:
    A (repetitive control added), B (position and disturbance estimators take over), C (the
    estimated defect is subtracted) or K' (a single controller of lower bandwidth). The true error
    is known here: its excursion within 5 ms after the scratch, and its amplitude at the rotation
    frequency, for the nominal drive and all twelve. Each is a distribution over draws of the noise,
    the scratch's angle, its edge and the sign of its displacement; strategies are compared in the
    same draw.

    depth, displacement: of the scratches, the latter in errors that can be read (2 um in focus,
    0.2 um radially). drive_count: how many of the twelve drives. draws: on each drive. values: of
    the drives. fault_filter: of C, the "high-pass" with the margins of figure 8.10, the "robust"
    one of `cd/<axis>/fault-filter`, or the one "with margins" of `cd/<axis>/designed-filter`. The
    robust one is designed for an estimate outside the loop, so C's loop is unstable with it while a
    defect lasts. gain: of the loops, each drive's "own", "equal", or as the "agc" sets it. delay
    [samples]: of the computer. noise, noise_fixed: reading of the printed amplitude of 0.15 um
    (`printed_noise`). quality: signal w_Q, "graded", "binary", or "prompt", which knows the
    scratches. length: of the larger scratch along the track [m].
    """
    F = chosen_filter(fault_filter, designed)
    K_prime = discretise(slower.answer.K, PERIOD)
    reading = BenchReading(gain, delay, noise, noise_fixed)
    experiment = Experiment(
        axis, values, depth, displacement, length=length, reading=reading, quality=quality
    )
    return StrategiesStudy(experiment, drive_count, draws, F, K_prime)


@dataclass(frozen=True, eq=False)
class StrategiesStudy(Study):
    """All strategies on the nominal drive and on others, with the same draws for all strategies."""

    experiment: Experiment
    drive_count: int
    draws: int
    F: StateSpace
    replacement: StateSpace

    headline: ClassVar[str] = "excursion_A_mean"

    @property
    def quantifier(self) -> str:
        return f"for {self.drive_count} drives, in {self.draws} simulated draws on each"

    @property
    def names(self) -> list[str]:
        """The nominal drive and the first of the twelve."""
        twelve = drives(self.experiment.axis, self.experiment.values)
        return ["nominal", *(drive.name for drive in twelve[: self.drive_count])]

    drive = dim(lambda self: self.names)
    draw = dim(lambda self: range(self.draws))
    strategy = dim(STRATEGIES)
    stage = dim(lambda self: list(self.experiment.windows()))
    signal = dim(SHOWN)
    wide_signal = dim(WIDE)
    side = dim("least", "largest")

    def played(self, drive: str, strategy: str, scratch: ScratchDraw, **how: Any) -> Record:
        """The experiment on a drive; ``how``: refine and noisy of `Experiment.scenario`."""
        one = self.experiment.scenario(drive, strategy, scratch, **how)
        return one.run(F=self.F, replacement=self.replacement)

    def outcomes(self, drive: str, scratch: ScratchDraw, **how: Any) -> list[StrategyOutcome]:
        """Outcome of every strategy in one draw."""
        records = (self.played(drive, strategy, scratch, **how) for strategy in STRATEGIES)
        return [self.experiment.outcome(record, scratch.angle) for record in records]

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, len(self.names), self.draws),
    )
    scratches = part(
        lambda self, seed: [
            [ScratchDraw.drawn(self.experiment.axis, one) for one in row]
            for row in seed.values.tolist()
        ]
    )
    scratch = arrays(
        (drive, draw),
        lambda scratches: {
            name: [[getattr(one, name) for one in row] for row in scratches]
            for name in ("angle", "sign", "edge")
        },
        angle=("rev", "where the scratch starts"), sign="", edge="",
    )  # fmt: skip

    @part
    def runs(self, context: Context, scratches: list[list[ScratchDraw]]) -> Any:
        """Outcomes (drives, draws, strategies, 4)."""
        cells = [
            (drive, one) for drive, row in zip(self.names, scratches, strict=True) for one in row
        ]
        found = context.spread(lambda cell: self.outcomes(*cell), cells, "drives and draws")
        return np.reshape(found, (-1, self.draws, len(STRATEGIES), 4))

    scores = arrays(
        (drive, draw, strategy),
        lambda runs: {name: runs[..., n] for n, name in enumerate(StrategyOutcome._fields)},
        excursion="m", periodic="m", events="", early_events="",
    )  # fmt: skip

    # --- the scratch of section 8.6 on the nominal drive --------------------------------------

    printed = part(lambda self, seed: self.experiment.printed(int(seed[0, 0])))

    @arrays(
        strategy,
        quiet_excursion=("m", "without noise, the printed scratch"),
        quiet_periodic=("m", "without noise, the printed scratch"),
    )
    def quiet(self, printed: ScratchDraw) -> dict[str, Any]:
        excursion, periodic, *_ = np.transpose(self.outcomes("nominal", printed, noisy=False))
        return {"quiet_excursion": excursion, "quiet_periodic": periodic}

    @part
    def nominal(self, printed: ScratchDraw) -> list[Record]:
        """One record of each strategy."""
        return [self.played("nominal", name, printed) for name in STRATEGIES]

    @part
    def finer(self, printed: ScratchDraw) -> list[Record]:
        """The same records with half the step of the simulation."""
        return [self.played("nominal", name, printed, refine=2) for name in STRATEGIES]

    def excursions(self, records: list[Record], printed: ScratchDraw) -> list[float]:
        return [self.experiment.outcome(one, printed.angle).excursion for one in records]

    excursion_shown = array(
        dims=strategy,
        unit="m",
        meaning="of the record shown",
        value=lambda self, nominal, printed: self.excursions(nominal, printed),
    )
    excursion_half_step = array(
        dims=strategy,
        unit="m",
        meaning="",
        value=lambda self, finer, printed: self.excursions(finer, printed),
    )
    half_step = array(
        dims=strategy,
        unit="m",
        meaning="largest difference of the lens position",
        value=lambda finer, nominal: [
            abs(a.x - b.x).max() for a, b in zip(finer, nominal, strict=True)
        ],
    )

    def on_drives(self, level: Any) -> list[float]:
        """A stability measure of the strategies' loops with each drive."""
        axis, values = self.experiment.axis, self.experiment.values
        believed = Strategies(axis, 1.0, ROTATION)
        bench = self.experiment.reading.laboratory
        return [level(believed, bench(axis, name, values)) for name in self.names]

    repetitive_level = array(
        dims=drive, unit="", meaning="", value=lambda self: self.on_drives(repetitive_level)
    )
    estimated_decay = array(
        dims=drive, unit="1/s", meaning="", value=lambda self: self.on_drives(estimated_decay)
    )

    # --- signals of the nominal drive ---------------------------------------------------------

    envelopes = part(lambda nominal: [[envelope(_signals(r)[s]) for s in WIDE] for r in nominal])
    time = dim(lambda envelopes: envelopes[0][0][1], unit="s")
    whole = array(
        dims=(strategy, wide_signal, side, time),
        value=lambda envelopes: [[one for one, _ in run] for run in envelopes],
    )

    zoomed = dim(lambda self: self.experiment.window_times, unit="ms")

    @array(dims=(strategy, stage, signal, zoomed), meaning="u [V], f_en [1], error [m], w_Q [1]")
    def zoom(self, nominal: list[Record]) -> Any:
        """Signals around a scratch, before and after the strategy takes over."""
        windows, runs = self.experiment.windows().values(), map(_signals, nominal)
        return np.array(
            [[[run[name][window] for name in SHOWN] for window in windows] for run in runs],
            np.float32,
        )

    # --- checks -------------------------------------------------------------------------------

    # --- claims -------------------------------------------------------------------------------

    other = dim(STRATEGIES)
    level = dim(LEVELS, meaning="share of the reference strategy's excursion")

    @array(dims=(strategy, level), unit="1")
    def reduced(self, excursion: DataArray, level: DataArray) -> DataArray:
        """Share of the draws, the reference strategy's error being bad, with a smaller excursion"""
        bad = excursion.sel(strategy="reference") > ACCEPTABLE_ERROR[self.experiment.axis]
        holds = (over_reference(excursion) <= level).where(bad)
        return share_of_draws(holds, "strategy", "level")

    @array(dims=(strategy, other), unit="1")
    def smaller(self, excursion: DataArray) -> DataArray:
        """Share of the draws in which a strategy's excursion is below the other one's"""
        below = excursion < excursion.rename(strategy="other")
        return share_of_draws(below, "strategy", "other")

    @array(dims=strategy, unit="1")
    def readable(self, excursion: DataArray) -> DataArray:
        """Share of the draws with an excursion that can be read"""
        return share_of_draws(excursion <= ACCEPTABLE_ERROR[self.experiment.axis], "strategy")

    # --- checks -------------------------------------------------------------------------------

    less = check(
        title="excursion {strategy}",
        statement="share of draws whose excursion is a larger part of the reference's than claimed",
        value=lambda reduced: unmet(reduced),
        each="strategy",
        at_most=1.0 - CLAIM_SHARE,
    )
    spared = check(
        title="readable {strategy}",
        statement="share of draws whose excursion cannot be read",
        value=lambda readable: 1.0 - readable.sel(strategy=["A", "B"]),
        each="strategy",
        at_most=1.0 - CLAIM_SHARE,
    )
    suppressed = check(
        title="periodic {strategy}",
        statement=f"share of draws whose periodic error is above {PERIODIC_SHARE:g} of the "
        "reference strategy's",
        value=lambda periodic: share_of_draws(
            over_reference(periodic).sel(strategy=["A", "B"]) > PERIODIC_SHARE, "strategy"
        ),
        each="strategy",
        at_most=1.0 - CLAIM_SHARE,
    )
    equal = check(
        title="periodic C",
        statement="share of draws whose periodic error differs from the reference strategy's by "
        f"more than {PERIODIC_DIFFERENCE:.0%}",
        value=lambda periodic: share_of_draws(
            abs(over_reference(periodic).sel(strategy="C") - 1.0) > PERIODIC_DIFFERENCE
        ),
        at_most=1.0 - CLAIM_SHARE,
    )
    kept = check(
        title="kept",
        statement="times that focus or track was lost or regained once a strategy had settled, "
        "all draws",
        value=lambda events: events.sel(strategy=["reference", *CLAIMED]).sum(),
        at_most=0.0,
    )
    repetitive_loop = check(
        title="repetitive loop",
        statement="largest |Q (1 - g T)| of strategy A, 1 is the limit of the small gain theorem",
        value=lambda repetitive_level: repetitive_level,
        at_most=1.0 - 1e-6,
        where="at {drive}",
    )
    estimated_loop = check(
        title="estimated loop",
        statement="growth of the slowest mode of strategy B [1/s]",
        value=lambda estimated_decay: -estimated_decay,
        at_most=0.0,
        where="at {drive}",
    )
    replayed = check(
        title="half the step",
        statement="largest relative change of an excursion when the optics are followed twice as "
        "finely",
        value=lambda excursion_half_step, excursion_shown: abs(
            excursion_half_step / excursion_shown - 1.0
        ),
        at_most=HALF_STEP_CHANGE,
        where="at {strategy}",
    )

    # --- what is told -------------------------------------------------------------------------

    excursions_of_nominal = metric(
        template="excursion_{strategy}_{summary}",
        value=lambda excursion: draws_summary(excursion.sel(drive="nominal")),
    )
    excursions_of_drives = metric(
        template="excursion_{strategy}_drives_{summary}",
        value=lambda excursion: draws_summary(excursion, "drive"),
    )
    periodics_of_nominal = metric(
        template="periodic_{strategy}_{summary}",
        value=lambda periodic: draws_summary(periodic.sel(drive="nominal")),
    )
    without_noise = metric(
        template="excursion_{strategy}_without_noise", value=lambda quiet_excursion: quiet_excursion
    )
    readable_share = metric("readable_{strategy}", value=lambda readable: readable)
    A_below_B = metric(lambda smaller: smaller.sel(strategy="A", other="B"))
    all_events = metric(
        template="draws_lost_{strategy}",
        value=lambda events: share_of_draws(events > 0, "strategy"),
    )
    lost_early = metric(
        template="draws_lost_early_{strategy}",
        value=lambda early_events: share_of_draws(early_events > 0, "strategy"),
    )
    worst_level = metric(
        template="repetitive_level", value=lambda repetitive_level: repetitive_level.max()
    )
    estimated_decay_per_s = metric(lambda estimated_decay: estimated_decay.min())
    half_step_m = metric(lambda half_step: half_step.max())

    errors = table(
        function=lambda self, excursion, periodic: error_tables(excursion, periodic, self.draws)
    )
    claims = table(lambda answer: claims_table(answer))

    @figure
    def signals(self, answer: Any) -> Any:
        return strategy_figures(answer, self.experiment.axis)


def _signals(record: Record) -> dict[str, Any]:
    error, quality = record.x_cd - record.x, record.signals["w_Q"]
    return {"u": record.u_dac, "f_en": record.f_en, "error": error, "w_Q": quality}
