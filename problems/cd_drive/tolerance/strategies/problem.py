"""Fault-tolerant strategies compared (sections 8.2-8.6, figures 8.7-8.9, A.1-A.6).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Run, problem, ref
from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import DataArray, StateSpace
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.synthesis import discretised
from workbench.systems.storage import restored
from workbench.tables import markdown

from ...diagnosis.defect_runs import ROTATION
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values, drives
from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ..strategy_looks import titled
from ..tactics import STRATEGIES, Strategies, stand_in_filter
from .figures import strategy_figures
from .runs import Experiment, StrategyOutcome, envelope
from .stability import estimated_decay, repetitive_level

SHOWN = ("u", "f_en", "error", "w_Q")
"""Signals that are stored about a scratch."""
WIDE = ("u", "f_en")
"""Signals that are stored over a whole run."""
EXCURSION_SHARE = {"A": 0.5, "B": 0.5, "C": 2 / 3, "K_prime": 2 / 3}
"""Largest excursion of each strategy, as a share of the reference strategy's."""
PERIODIC_SHARE = 0.1
"""Largest periodic error of strategies A and B, as a share of the reference strategy's."""
PERIODIC_DIFFERENCE = 0.1
"""Largest relative difference of strategy C's periodic error from the reference strategy's, whose
open loop is the same (section 8.6)."""
HALF_STEP_CHANGE = 0.05
"""Largest relative change of an excursion when the simulation's step is halved."""

Filter = Literal["high-pass", "robust"]


def needs(axis: str, fault_filter: Filter = "high-pass", **_: Any) -> dict[str, Any]:
    """K', and the designed fault filter where it is asked for."""
    found: dict[str, Any] = {"slower": ref(f"cd/{axis}/lower-bandwidth")}
    if fault_filter == "robust" and axis == "focus":
        found["designed"] = ref("cd/focus/fault-filter")
    return found


@problem(
    "cd/{axis}/strategies",
    axis=("focus", "radial"),
    needs=needs,
    data=(*TABLES, "data/red_book.csv"),
)
def strategies(
    axis: Axis,
    slower: Run,
    designed: Run | None = None,
    depth: Annotated[float, Field(ge=0.6, le=0.9)] = 0.7,
    displacement: Annotated[float, Field(ge=0, le=1)] = 0.5,
    drive_count: Annotated[int, Field(ge=0, le=12)] = 12,
    values: Values = "printed",
    fault_filter: Filter = "high-pass",
) -> StrategiesStudy:
    """Strategies against surface defects (figures 8.7-8.9, A.1-A.6).

    A disc of the largest deviation, 500 um in focus and 70 um radially, turns at 5.5 Hz with a
    scratch of 1.2 mm, a minor one and a false detection. For a second the reference strategy is in
    charge, which zeroes the error by the quality signal; then A (repetitive control beside it), B
    (position and disturbance estimators take over), C (the estimated defect is removed) or K' (one
    controller of lower bandwidth). The true error is known here: its excursion within 5 ms after
    the scratch, and its amplitude at the rotation frequency, for the nominal drive and all twelve.

    depth, displacement: of the scratches, the latter in errors that can be read (2 um in focus,
    0.2 um radially). drive_count: how many of the twelve drives. values: of the drives.
    fault_filter: of C, the "high-pass" with the margins of figure 8.10, or in focus the "robust"
    one of `cd/focus/fault-filter`: made for an estimate beside the loop, it leaves C's loop
    unstable while a defect lasts.
    """
    F = stand_in_filter()
    if fault_filter == "robust":
        if designed is None:
            raise InputError(f"there is no robust fault filter for {axis}; ask for the high-pass")
        F = restored(designed.data, "discrete")
    K_prime = discretised(slower.answer.K, PERIOD)
    experiment = Experiment(axis, values, depth, displacement)
    return StrategiesStudy(experiment, drive_count, F, K_prime)


@dataclass(frozen=True, eq=False)
class StrategiesStudy(Study):
    """All strategies on the nominal drive and on others, with the same noise for all."""

    experiment: Experiment
    drive_count: int
    F: StateSpace
    replacement: StateSpace

    headline: ClassVar[str] = "excursion_A"

    @property
    def quantifier(self) -> str:
        return f"for {self.drive_count} drives, in one simulated record of each"

    @property
    def names(self) -> list[str]:
        """The nominal drive and the first of the twelve."""
        twelve = drives(self.experiment.axis, self.experiment.values)
        return ["nominal", *(drive.name for drive in twelve[: self.drive_count])]

    drive = dim(lambda self: self.names)
    strategy = dim(STRATEGIES)
    stage = dim(lambda self: list(self.experiment.windows()))
    signal = dim(SHOWN)
    wide_signal = dim(WIDE)
    side = dim("least", "largest")

    def played(self, drive: str, strategy: str, seed: int, refine: int = 1) -> Record:
        """The experiment on a drive; ``refine`` divides the step of the simulation."""
        designs: dict[str, Any] = {"F": self.F, "replacement": self.replacement}
        return self.experiment.run(drive, strategy, seed, refine, **designs)

    seed = part(lambda context: int(context.rng.integers(2**31)))

    @part
    def runs(self, context: Context, seed: int) -> tuple[Any, list[Record]]:
        """Outcomes (drives, strategies, 3), and the records of the nominal drive."""
        pairs = [(drive, strategy) for drive in self.names for strategy in STRATEGIES]
        outcomes: list[StrategyOutcome] = []
        nominal: list[Record] = []
        for drive, strategy in context.track(pairs, "drives and strategies"):
            record = self.played(drive, strategy, seed)
            outcomes.append(self.experiment.outcome(record))
            nominal += [record] if drive == "nominal" else []
        return np.reshape(outcomes, (-1, len(STRATEGIES), 3)), nominal

    scores = arrays(
        (drive, strategy),
        lambda runs: {name: runs[0][..., n] for n, name in enumerate(StrategyOutcome._fields)},
        excursion="m", periodic="m", events="",
    )  # fmt: skip
    nominal = part(lambda runs: runs[1])

    @part
    def finer(self, context: Context, seed: int) -> list[Record]:
        """Records of the nominal drive at half the step."""
        names = context.track(list(STRATEGIES), "half the step")
        return [self.played("nominal", name, seed, refine=2) for name in names]

    excursion_half_step = array(
        strategy, "m", "", lambda self, finer: [self.experiment.outcome(r).excursion for r in finer]
    )
    half_step = array(
        strategy,
        "m",
        "largest difference of the lens position",
        lambda finer, nominal: [abs(a.x - b.x).max() for a, b in zip(finer, nominal, strict=True)],
    )

    def on_drives(self, level: Any) -> list[float]:
        """A stability measure of the strategies' loops with each drive."""
        axis, values = self.experiment.axis, self.experiment.values
        believed = Strategies(axis, 1.0, ROTATION)
        return [level(believed, Laboratory(axis, name, values)) for name in self.names]

    repetitive_level = array(drive, "", "", lambda self: self.on_drives(repetitive_level))
    estimated_decay = array(drive, "1/s", "", lambda self: self.on_drives(estimated_decay))

    # --- signals of the nominal drive ---------------------------------------------------------

    envelopes = part(lambda nominal: [[envelope(_signals(r)[s]) for s in WIDE] for r in nominal])
    time = dim(lambda envelopes: envelopes[0][0][1], unit="s")
    whole = array(
        (strategy, wide_signal, side, time),
        value=lambda envelopes: [[one for one, _ in run] for run in envelopes],
    )

    zoomed = dim(lambda self: self.experiment.window_times, unit="ms")

    @array((strategy, stage, signal, zoomed), meaning="u [V], f_en [1], error [m], w_Q [1]")
    def zoom(self, nominal: list[Record]) -> Any:
        """Signals about a scratch before and after the strategy is engaged."""
        windows, runs = self.experiment.windows().values(), map(_signals, nominal)
        return np.array(
            [[[run[name][window] for name in SHOWN] for window in windows] for run in runs],
            np.float32,
        )

    # --- checks -------------------------------------------------------------------------------

    @check(
        "excursion {strategy}",
        "largest excursion after the scratch over that of the reference strategy",
        at_most=EXCURSION_SHARE,
        each="strategy",
        where="at {drive}",
    )
    def smaller(self, excursion: DataArray) -> DataArray:
        return _over_reference(excursion).sel(strategy=list(EXCURSION_SHARE))

    @check(
        "periodic {strategy}",
        "largest periodic error over that of the reference strategy",
        at_most=PERIODIC_SHARE,
        each="strategy",
        where="at {drive}",
    )
    def suppressed(self, periodic: DataArray) -> DataArray:
        return _over_reference(periodic).sel(strategy=["A", "B"])

    equal = check(
        "periodic C",
        "largest difference of the periodic error from the reference strategy's, relative",
        lambda periodic: abs(_over_reference(periodic).sel(strategy="C") - 1.0),
        at_most=PERIODIC_DIFFERENCE,
        where="at {drive}",
    )
    kept = check(
        "kept",
        "times that focus or track was lost or regained, all drives",
        lambda events: events.sel(strategy=["reference", *EXCURSION_SHARE]).sum(),
        at_most=0.0,
    )
    repetitive_loop = check(
        "repetitive loop",
        "largest |Q (1 - g T)| of strategy A, 1 is the limit of the small gain theorem",
        lambda repetitive_level: repetitive_level,
        at_most=1.0 - 1e-6,
        where="at {drive}",
    )
    estimated_loop = check(
        "estimated loop",
        "growth of the slowest mode of strategy B [1/s]",
        lambda estimated_decay: -estimated_decay,
        at_most=0.0,
        where="at {drive}",
    )
    replayed = check(
        "half the step",
        "largest relative change of an excursion when the optics are followed twice as finely",
        lambda excursion_half_step, excursion: abs(
            excursion_half_step / excursion.sel(drive="nominal") - 1.0
        ),
        at_most=HALF_STEP_CHANGE,
        where="at {strategy}",
    )

    # --- what is told -------------------------------------------------------------------------

    nominal_excursion = metric(
        "excursion_{strategy}", lambda excursion: excursion.sel(drive="nominal")
    )
    worst_excursion = metric("excursion_{strategy}_worst", lambda excursion: excursion.max("drive"))
    nominal_periodic = metric("periodic_{strategy}", lambda periodic: periodic.sel(drive="nominal"))
    worst_periodic = metric("periodic_{strategy}_worst", lambda periodic: periodic.max("drive"))
    all_events = metric("events_{strategy}", lambda events: events.sum("drive"))
    worst_level = metric("repetitive_level", lambda repetitive_level: repetitive_level.max())
    estimated_decay_per_s = metric(lambda estimated_decay: estimated_decay.min())
    half_step_m = metric(lambda half_step: half_step.max())

    @table
    def errors(self, excursion: DataArray, periodic: DataArray) -> dict[str, str]:
        """Excursion and periodic error by drive and strategy."""
        titles = (
            "Largest true error within 5 ms after the 1.2 mm scratch [um]",
            "Amplitude of the true error at the rotation frequency [um]",
        )
        return {
            str(values.name): f"{title}.\n\n" + _by_drive(1e6 * values)
            for values, title in zip((excursion, periodic), titles, strict=True)
        }

    @figure
    def signals(self, answer: Any) -> Any:
        return strategy_figures(answer, self.experiment.axis)


def _signals(record: Record) -> dict[str, Any]:
    error, quality = record.x_cd - record.x, record.signals["w_Q"]
    return {"u": record.u_dac, "f_en": record.f_en, "error": error, "w_Q": quality}


def _over_reference(values: DataArray) -> DataArray:
    """Values of every strategy over those of the reference strategy."""
    return values / values.sel(strategy="reference")


def _by_drive(values: DataArray) -> str:
    heads = ["drive", *(titled(name) for name in values["strategy"].values)]
    rows = zip(values["drive"].values, values.values, strict=True)
    return markdown(heads, [[drive, *(f"{one:.3g}" for one in row)] for drive, row in rows])
