"""Strategy C with fault filters that are designed (sections 8.5 to 8.7).

Section, equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, problem, ref
from workbench.diagnosis import DemandReached, FaultLoop
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
    system,
    table,
)
from workbench.synthesis import SAMPLINGS
from workbench.systems import bilinear_sampled, loop_response, restored_system
from workbench.types import DataArray, Dataset, RealArray, StateSpace
from workbench.uncertainty import UncertaintyModel

from ...control.loops import plants
from ...diagnosis.fault_filter.demand import (
    demand_check,
    demand_table,
    in_metrics,
    reached_arrays,
    reached_of,
)
from ...diagnosis.fault_filter.loop import fault_loop
from ...diagnosis.fault_filter.problem import allowed_leakage, stadiums_of
from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import PERIOD
from ..strategies.runs import Experiment, StrategyOutcome
from ..tactics import stand_in_filter
from . import report
from .design import MarginsDesign
from .loops import CONDITIONS, certified, delayed_margins, drive_checks, filter_checks

FILTERS = ("high-pass", "estimation", "with margins")
"""Fault filters of strategy C: the stand-in of 450 Hz, that of `cd/<axis>/fault-filter`, and the
one designed here.
"""
CASES = ("reference", *FILTERS)
"""The reference strategy, and strategy C with each filter."""
MARGINS = FILTERS[-1]
PEAKS = (2.0, 3.0, 6.0)
"""Largest |S| while a defect passes, at the points of the front."""
ERRORS = (0.4, 0.5, 0.6)
"""Allowed relative errors of the estimate, at the points of the front."""
LENGTHS = (1.2e-3, 2.5e-3)
"""Lengths of scratches [m]: that of section 8.6, and the longest that the error correction repairs.
"""
FREQUENCY = np.geomspace(10.0, 17e3, 300)
"""Frequencies [Hz] at which the nominal loops are shown."""


@problem(
    "cd/{axis}/designed-filter",
    slow=True,
    axis=("focus", "radial"),
    needs=lambda axis, **_: {
        "covered": ref(f"cd/{axis}/cover-for-control"),
        "estimation": ref(f"cd/{axis}/fault-filter"),
    },
    data=(*TABLES, "data/red_book.csv"),
)
def designed_filter(
    axis: Axis,
    covered: Run,
    estimation: Run,
    peak: Annotated[float, Field(gt=1.0, le=100.0)] = 3.0,
    error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.5,
    leakage: Annotated[float, Field(gt=0.0, le=1e-4)] | None = None,
    order: Annotated[int, Field(ge=1, le=20)] = 10,
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
    drive_count: Annotated[int, Field(ge=0, le=12)] = 12,
    draws: Annotated[int, Field(ge=1, le=1000)] = 6,
) -> DesignedFilter:
    """Strategy C with fault filters that are designed: its loop in a defect, and what it does.

    While a defect passes, C controls by e - u_f = (1 - F) e, so the loop is that of K (1 - F). The
    filter of `cd/<axis>/fault-filter` is designed for the estimate alone and makes that loop
    unstable. Here its sensitivity is bounded for every plant of the set as a further requirement
    (section 8.5 proposes trial and error), besides those on the estimate. A half-plane makes this
    requirement convex in the filter; mu then certifies it. A peak of 3 implies a gain margin of 3.5
    dB and a phase margin of 19 degrees; figure 8.10 has about 3 dB and 8 degrees. If on every plant
    no filter has this error and sensitivity with a leakage below a quarter of the acceptable error,
    the set is reduced to what the loop tolerates, and these limits are increased by their least
    common factor.

    Each filter and the reference strategy are compared in the experiment of `cd/<axis>/strategies`,
    with scratches of 1.2 and 2.5 mm, in the same draws.

    peak: largest sensitivity while a defect passes. error: relative error of the estimate. leakage,
    order, delay: as in `cd/<axis>/fault-filter`. drive_count: how many of the twelve drives. draws:
    number of draws on each drive.
    """
    return DesignedFilter(
        axis,
        stadiums_of(covered),
        restored_system(estimation.data, "discrete"),
        peak,
        (error, leakage or allowed_leakage(axis)),
        order,
        delay,
        drive_count,
        draws,
    )


@dataclass(frozen=True, eq=False)
class DesignedFilter(Study):
    """The front with bounded sensitivity, a filter on it, the loop with every filter, and
    experiments.
    """

    axis: Axis
    model: UncertaintyModel
    estimation: StateSpace
    peak: float
    limits: tuple[float, float]
    order: int
    delay: float
    drive_count: int
    draws: int

    headline: ClassVar[str] = "peak_robust_with_margins"

    @property
    def quantifier(self) -> str:
        return f"for these filters, in {self.draws} simulated draws on each drive"

    @cached_property
    def loop(self) -> FaultLoop:
        """The loop with the axis' reference controller, as a computer closes it."""
        import control

        return fault_loop(self.axis, self.model, control.ss(controller(self.axis)), self.delay)

    @property
    def names(self) -> list[str]:
        """The first of the twelve drives, and the nominal one."""
        return [*(one.name for one in drives(self.axis)[: self.drive_count]), "nominal"]

    # --- the design ---------------------------------------------------------------------------

    filter, case, bound = dim(FILTERS), dim(CASES), dim("lower", "upper")
    peak_allowed = dim(PEAKS, unit="1", meaning="sensitivity allowed")
    point = dim(ERRORS, unit="1", meaning="relative error allowed")
    quantity = dim("error", "leakage", "noise", "sensitivity")

    @array(dims=(peak_allowed, point, quantity), unit="1", meaning="front; NaN where no filter is")
    def front(self, reached: DemandReached, context: Context) -> RealArray:
        every = context.track([(peak, error) for peak in PEAKS for error in ERRORS], "front")
        found = [self.made.on_front(reached.share, error, peak) for peak, error in every]
        return np.reshape(found, (len(PEAKS), len(ERRORS), -1))

    @cached_property
    def made(self) -> MarginsDesign:
        """The design of the filter with margins."""
        return MarginsDesign(self.loop, (*self.limits, self.peak), self.order)

    design = part(lambda self: self.made.best())
    reached = part(lambda design: design[0])
    demand_factor, set_share, allowed, leakage_allowed = reached_arrays(
        lambda self, reached: self.made.limits(reached)
    )
    designed = system(called="designed")(lambda design: bilinear_sampled(design[1].F, PERIOD))

    def every(self, designed: StateSpace) -> dict[str, StateSpace]:
        """Discrete fault filters by name."""
        made = (stand_in_filter(), self.estimation, designed)
        return dict(zip(FILTERS, made, strict=True))

    filters = part(lambda self, designed: self.every(designed))

    # --- loops while a defect passes ----------------------------------------------------------

    sampling = dim(SAMPLINGS)
    plant = dim(lambda self: list(plants(self.axis, "own", "printed")))
    condition = dim(CONDITIONS)
    frequency = dim(FREQUENCY, unit="Hz")

    @arrays((filter, sampling, plant), gain_margin="dB", phase_margin="deg", growth="1/s")
    def margins(self, filters: dict[str, StateSpace]) -> dict[str, RealArray]:
        """Margins (NaN if the loop is unstable), and the decay rate of the slowest mode."""
        found = delayed_margins(self.axis, filters, self.delay)
        return {
            "gain_margin": found.gain_db,
            "phase_margin": found.phase_deg,
            "growth": found.growth,
        }

    @array(
        dims=(filter, condition, bound),
        unit="1",
        meaning="certified; infinite where the nominal is unstable",
    )
    def removal(self, filters: dict[str, StateSpace], context: Context) -> list[RealArray]:
        every = context.track(list(filters.values()), "certified loops")
        return [certified(self.loop, F, self.peak) for F in every]

    @part
    def responses(self, filters: dict[str, StateSpace]) -> RealArray:
        """L (1 - F) of the nominal loops."""
        omega = self.loop.warped_omega(FREQUENCY)
        F = np.array([loop_response(one, FREQUENCY) for one in filters.values()])
        return np.asarray((1 - F) * self.loop.open_loop(omega))

    L_real = array(
        dims=(filter, frequency), unit="1", meaning="", value=lambda responses: responses.real
    )
    L_imag = array(
        dims=(filter, frequency), unit="1", meaning="", value=lambda responses: responses.imag
    )

    # --- experiments --------------------------------------------------------------------------

    length = dim(LENGTHS, unit="m")
    drive = dim(lambda self: self.names)
    draw = dim(lambda self: range(self.draws))

    @array(dims=(drive, draw))
    def seed(self, context: Context, drive: DataArray) -> Any:
        return independent_seeds(context.rng, drive.size, self.draws)

    def outcomes(
        self, filters: dict[str, StateSpace], drive: str, seed: int
    ) -> list[list[StrategyOutcome]]:
        """Outcomes [lengths][cases] of one draw."""
        scratch, found = ScratchDraw.drawn(self.axis, seed), []
        for length in LENGTHS:
            experiment = Experiment(self.axis, length=length)
            played = {name: experiment.scenario(drive, "C", scratch) for name in FILTERS}
            records = [experiment.scenario(drive, "reference", scratch).run()]
            records += [one.run(F=filters[name]) for name, one in played.items()]
            found.append([experiment.outcome(one, scratch.angle) for one in records])
        return found

    @part
    def met(self, filters: Any, seed: DataArray, context: Context) -> RealArray:
        """Outcomes (drives, draws, lengths, cases, 4)."""
        cells = [
            (str(name), int(one))
            for name, row in zip(seed["drive"].values, seed.values, strict=True)
            for one in row
        ]
        found = context.spread(lambda cell: self.outcomes(filters, *cell), cells, "draws")
        return np.reshape(found, (*seed.shape, len(LENGTHS), len(CASES), -1))

    scores = arrays(
        (drive, draw, length, case),
        lambda met: {name: met[..., n] for n, name in enumerate(StrategyOutcome._fields)},
        excursion="m", periodic="m", events="", early_events="",
    )  # fmt: skip

    # --- checks -------------------------------------------------------------------------------

    @check(title="excursion {case}", at_most=1.0 - CLAIM_SHARE, each="case")
    def less(self, excursion: DataArray) -> DataArray:
        """share of draws whose reference cannot be read in which 1.2 mm cost no less with C"""
        one = excursion.sel(length=LENGTHS[0])
        reference = one.sel(case="reference")
        no_less = one.sel(case=list(FILTERS[1:])) >= reference
        bad = reference > ACCEPTABLE_ERROR[self.axis]
        return share_of_draws(no_less.where(bad), "case").fillna(0.0)

    kept = check(
        title="kept {case}",
        statement="share of draws in which a defect of 1.2 mm loses focus or track",
        value=lambda events: share_of_draws(
            (events > 0).sel(length=LENGTHS[0], case=list(FILTERS[1:])), "case"
        ),
        each="case",
        at_most=1.0 - CLAIM_SHARE,
    )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        F, reached = self.designed_of(answer), reached_of(answer)
        asked = self.made.limits(reached)
        found = [
            *super().checks(answer, tolerance),
            demand_check(answer, asked[:2]),
            *filter_checks(self.loop, F, self.order, asked, reached),
        ]
        if reached.share >= 1.0:  # all drives are plants of the set
            found += drive_checks(self.axis, F, self.delay, asked[2])
        return found

    def designed_of(self, answer: Dataset) -> StateSpace:
        """The stored filter."""
        return restored_system(answer, "designed")

    # --- what is told -------------------------------------------------------------------------

    def smaller(self, answer: Dataset) -> DataArray:
        """Share of draws in which an excursion is below the reference strategy's."""
        excursion = answer["excursion"]
        return share_of_draws(excursion < excursion.sel(case="reference"), "case", "length")

    @metric
    def told(self, answer: Dataset) -> dict[str, float]:
        """Margins and certified peaks of every loop, and the excursions that the scratches
        cause.
        """
        found = in_metrics(answer, *self.limits)
        found["sensitivity_allowed"] = self.made.limits(reached_of(answer))[2]
        late = answer.sel(sampling="delayed")
        for name in FILTERS:
            key = name.replace(" ", "_").replace("-", "_")
            one, bounds = late.sel(filter=name), answer["removal"].sel(filter=name, bound="upper")
            found[f"growth_{key}"] = float(one["growth"].max())
            found[f"unstable_{key}"] = float((one["growth"] > 0).sum())
            for kind in ("gain_margin", "phase_margin"):
                every = one[kind].where(one["growth"] < 0)
                found[f"{kind}_{key}"] = float(every.min()) if every.notnull().all() else np.nan
            found[f"mu_{key}"] = float(bounds.sel(condition="robust stability"))
            found[f"peak_robust_{key}"] = self.peak * float(bounds.sel(condition=CONDITIONS[2]))
        smaller = self.smaller(answer)
        for length in LENGTHS:
            for name in CASES:
                key = f"{name.replace(' ', '_').replace('-', '_')}_{1e3 * length:.1f}mm"
                at = {"length": length, "case": name}
                summary = draws_summary(answer["excursion"].sel(at), "drive")
                for which in summary["summary"].values:
                    found[f"excursion_{key}_{which}"] = float(summary.sel(summary=which))
                found[f"below_reference_{key}"] = float(smaller.sel(at))
                found[f"lost_{key}"] = float((answer["events"].sel(at) > 0).mean())
        return found

    @table
    def demand(self, answer: Dataset) -> Any:
        """Table of the reached part of the demand on the filter with margins."""
        reached = f"{self.made.limits(reached_of(answer))[2]:.4g}"
        return demand_table(answer, *self.limits, ["sensitivity", f"{self.peak:.4g}", reached])

    loops_ = table(lambda self, answer: {"loops": report.loops(answer, self.peak)})
    experiments = table(
        function=lambda self, answer: {
            "experiments": report.experiments(answer, self.smaller(answer))
        }
    )
    front_ = table(lambda answer: {"front": report.front(answer)})
    figure_8_10 = figure(lambda self, answer: report.figure_8_10(answer, self.axis))
    excursions = figure(lambda self, answer: report.excursions(answer, self.axis))
    costs = figure(lambda self, answer: report.costs(answer, self.axis))
