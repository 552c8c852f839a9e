"""Fault-tolerant strategies compared (sections 8.2-8.6, figures 8.7-8.9, A.1-A.6).

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref
from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.systems.storage import restored

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values, drives
from ...laboratory.bench_setup import RATE
from ...laboratory.experiment import Laboratory
from ..tactics import STRATEGIES, Strategies, stand_in_filter
from .checks import checks_of
from .report import figures_of, numbers_of, tables_of
from .runs import ROTATION, WINDOW, Experiment, envelope
from .stability import estimated_decay, repetitive_level

if TYPE_CHECKING:
    from ...laboratory.record import Record

SHOWN = ("u", "f_en", "error", "w_Q")
"""Signals about a scratch."""


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
    replacement = restored(slower.data, "sampled")
    experiment = Experiment(axis, values, depth, displacement)
    return StrategiesStudy(experiment, drive_count, F, replacement)


@dataclass(frozen=True, eq=False)
class StrategiesStudy(Study):
    """All strategies on the nominal drive and on others, the same noise for all."""

    experiment: Experiment
    drive_count: int
    F: StateSpace
    replacement: StateSpace

    headline: ClassVar[str] = "excursion_A"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        seed, experiment = int(context.rng.integers(2**31)), self.experiment
        designs: dict[str, Any] = {"F": self.F, "replacement": self.replacement}
        axis, values = experiment.axis, experiment.values
        twelve = [drive.name for drive in drives(axis, values)][: self.drive_count]
        names, cases = ("nominal", *twelve), tuple(STRATEGIES)
        outcome = np.zeros((len(names), len(cases), 3))
        shown: dict[str, Record] = {}
        pairs = [(i, j) for i in range(len(names)) for j in range(len(cases))]
        for i, j in context.track(pairs, "drives and strategies"):
            record = experiment.run(names[i], cases[j], seed, **designs)
            outcome[i, j] = experiment.outcome(record)
            if i == 0:
                shown[cases[j]] = record
        finer = {
            name: experiment.run("nominal", name, seed, refine=2, **designs)
            for name in context.track(cases, "half the step")
        }
        benches = [Laboratory(axis, name, values) for name in names]
        believed = Strategies(axis, 1.0, ROTATION)
        meter: dict[str, str] = {"units": "m"}
        per = ("drive", "strategy")
        return xr.Dataset(
            {
                "excursion": (per, outcome[:, :, 0], meter),
                "periodic": (per, outcome[:, :, 1], meter),
                "events": (per, outcome[:, :, 2]),
                "excursion_half_step": (
                    "strategy",
                    [experiment.outcome(finer[name]).excursion for name in cases],
                    meter,
                ),
                "half_step": (
                    "strategy",
                    [float(abs(finer[name].x - shown[name].x).max()) for name in cases],
                    meter | {"long_name": "largest difference of the lens position"},
                ),
                "repetitive_level": (
                    "drive",
                    [repetitive_level(believed, bench) for bench in benches],
                ),
                "estimated_decay": (
                    "drive",
                    [estimated_decay(believed, bench) for bench in benches],
                    {"units": "1/s"},
                ),
                **self._traces(shown),
            },
            {
                "drive": list(names),
                "strategy": list(cases),
                "stage": list(experiment.windows()),
                "signal": list(SHOWN),
                "side": ["least", "largest"],
            },
        )

    def _traces(self, shown: dict[str, Record]) -> dict[str, Any]:
        """Whole runs as envelopes, and windows about a scratch, of the nominal drive."""
        windows = self.experiment.windows()
        runs = [_signals(record) for record in shown.values()]
        zoom = [
            [[run[signal][window] for signal in SHOWN] for window in windows.values()]
            for run in runs
        ]
        whole = [[envelope(run[signal])[0] for signal in ("u", "f_en")] for run in runs]
        size = len(zoom[0][0][0])
        return {
            "whole": (("strategy", "wide_signal", "side", "time"), whole),
            "wide_signal": ["u", "f_en"],
            "time": ("time", envelope(runs[0]["u"])[1], {"units": "s"}),
            "zoom": (
                ("strategy", "stage", "signal", "zoomed"),
                np.array(zoom, np.float32),
                {"long_name": "u [V], f_en [1], error [m], w_Q [1]"},
            ),
            "zoomed": ("zoomed", 1e3 * (WINDOW[0] + np.arange(size) / RATE), {"units": "ms"}),
        }

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return checks_of(answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        return numbers_of(answer)

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.experiment.axis)


def _signals(record: Record) -> dict[str, Any]:
    return {
        "u": record.u_dac,
        "f_en": record.f_en,
        "error": record.x_cd - record.x,
        "w_Q": record.signals["w_Q"],
    }
