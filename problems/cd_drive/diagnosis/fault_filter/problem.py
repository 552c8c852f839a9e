"""The robust fault filter: how much of a defect is estimated, how much of the disc leaks in.

Section, figure and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003), section 7.2.1 and figures 7.8, 7.12 and 7.13. The printed scalings leave
open what they scale (`cd/*/printed-filter`); here the two channels are the relative error of the
estimate and the leakage in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, problem, ref
from workbench.diagnosis import (
    DemandReached,
    FaultFront,
    FaultLoop,
    FrontFilter,
    LaguerreBasis,
    best_design,
    full_order_filter,
    least_total_error,
    low_order_filter,
)
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting import restored_rational
from workbench.study import Study, array, dim, figure, identifier, part, system, table
from workbench.systems import bilinear_sampled
from workbench.types import Dataset, StateSpace
from workbench.uncertainty import UncertaintyModel

from ...control.cover_for_control.problem import PARTS, STAGES
from ...drive.plants import Gain, controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from . import figures
from .checks import filter_checks
from .defect_estimates import SHAPES, estimates, sampled_defect
from .demand import demand_check, demand_table, in_metrics, reached_arrays, reached_of
from .figures import NAMES, shape_errors, total
from .loop import BOUND_CORNER, LAGUERRE_POLE, fault_loop, fine_grid, grid
from .peers import peer_filters

ERRORS = (0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6)
"""Relative errors allowed at the points of the front."""
KINDS = ("nominal plant", "every plant")
"""Plants for which a filter is judged."""
COUNTS = CONTINUOUS, SAMPLED = 16, 20
"""Numbers of Laguerre basis functions for the continuous loop and for the sampled one."""


def needs(axis: str = "focus", frequencies: int = 400, gain: Gain = "own", **_: Any) -> Any:
    """Reference to the stadiums chosen for control: around the narrowest ones no loop is robustly
    stable.
    """
    return {
        "covered": ref(f"cd/{axis}/cover-for-control", frequencies=frequencies, gain=gain),
    }


@problem("cd/focus/fault-filter", slow=True, needs=needs, data=TABLES)
def fault_filter(
    covered: Run,
    frequencies: Frequencies = 400,
    gain: Gain = "own",
    error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.3,
    leakage: Annotated[float, Field(gt=0.0, le=1e-4)] = 0.5e-6,
    order: Annotated[int, Field(ge=1, le=20)] = 10,
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
) -> FaultFilterStudy:
    """A filter that estimates surface defects on every drive, and leaves the disc's deviation out.

    The chosen point is the bend of the front. Below a relative error of 0.3, every plant's total
    rises steeply, by half for an error less by 0.05; above 0.3 it falls by less than a third for an
    error more by 0.1. At 0.3 the disc's leakage is a quarter of the 2 um by which the loop itself
    may be off. If no filter keeps both limits on every plant, the set is reduced to what the loop
    tolerates, and error and leakage are increased by their least common factor.

    frequencies, gain: of the stadiums, as in `cd/focus/cover-for-control`, and of the drives in
    whose loops defects are estimated. error: wanted relative
    error from 1.5 kHz. leakage: wanted leakage of the Red Book's envelope into the estimate [m], up
    to 200 Hz. order: of the sampled filter. delay: of the sampled loop [samples].
    """
    return FaultFilterStudy("focus", stadiums_of(covered), error, leakage, order, delay, gain)


@problem(
    "cd/radial/fault-filter",
    slow=True,
    needs=lambda **chosen: needs("radial", **chosen),
    data=(*TABLES, "data/red_book.csv"),
)
def radial_fault_filter(
    covered: Run,
    frequencies: Frequencies = 400,
    gain: Gain = "own",
    error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.3,
    leakage: Annotated[float, Field(gt=0.0, le=1e-4)] = 0.05e-6,
    order: Annotated[int, Field(ge=1, le=20)] = 10,
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
) -> FaultFilterStudy:
    """The same of the radial loop, with the same requirements in units of its acceptable error.

    frequencies, gain: of the stadiums, as in `cd/radial/cover-for-control`, and of the drives.
    error, leakage, order, delay: as in `cd/focus/fault-filter`.
    """
    return FaultFilterStudy("radial", stadiums_of(covered), error, leakage, order, delay, gain)


def allowed_leakage(axis: Axis) -> float:
    """A quarter of the error that can be read [m]."""
    return ACCEPTABLE_ERROR[axis] / 4


def stadiums_of(covered: Run) -> UncertaintyModel:
    """The stadiums of `cd/<axis>/cover-for-control`."""
    nominal, W_c, W_r = (
        restored_rational(covered.data, prefix=f"{name}{len(STAGES) - 1}_") for name in PARTS
    )
    return UncertaintyModel(nominal, W_c, W_r)


@dataclass(frozen=True, eq=False)
class FaultFilterStudy(Study):
    """The front, filters at one of its points, and defects that they estimate."""

    axis: Axis
    model: UncertaintyModel
    error: float
    leakage: float
    order: int
    delay: float
    gain: Gain

    headline: ClassVar[str] = "leakage"

    @property
    def quantifier(self) -> str:
        return "for these filters"

    @cached_property
    def loops(self) -> dict[str, FaultLoop]:
        """Loops with the axis' reference controller: in continuous time, and as a computer closes
        it.
        """
        import control

        K = control.ss(controller(self.axis))
        return {
            "full": fault_loop(self.axis, self.model, K),
            "discrete": fault_loop(self.axis, self.model, K, self.delay),
        }

    def within(self, share: float) -> dict[str, FaultLoop]:
        """The loops around this share of the set."""
        return {name: loop.within(share) for name, loop in self.loops.items()}

    def fronts(self, which: str, share: float) -> list[FaultFront]:
        """The front of a loop for each of KINDS, around this share of the set."""
        loop = self.within(share)[which]
        return [FaultFront(loop, grid(loop), nominal=kind == KINDS[0]) for kind in KINDS]

    kind, bound = dim(KINDS), dim("lower", "upper")
    point = dim(ERRORS, unit="1", meaning="relative error allowed")
    quantity = dim("error", "leakage", "noise")

    design = dim("full", "discrete")
    requirement = dim(
        lambda self: [one.name for one in self.loops["full"].requirements(self.error, self.leakage)]
    )

    # --- the filters ---------------------------------------------------------------------------

    @part
    def chosen(self) -> tuple[DemandReached, dict[str, FrontFilter]]:
        """The reached part of the demand, and filters that reach it."""
        return best_design(list(self.loops.values()), self._least_factor, self._designed)

    def limits(self, reached: DemandReached) -> tuple[float, float]:
        """Reached limits of the relative error and of the leakage [m]."""
        return reached.factor * self.error, reached.factor * self.leakage

    def _least_factor(self, reached: DemandReached) -> float:
        """Least factor on the limits that filters of full order reach for both loops."""
        found = []
        for loop, count in zip(self.within(reached.share).values(), COUNTS, strict=True):
            front = FaultFront(loop, grid(loop))
            basis = LaguerreBasis(loop, LAGUERRE_POLE).response(front.omega, count)
            found.append(front.least_factor(basis, *self.limits(reached)))
        return max(found)

    def _designed(self, reached: DemandReached) -> dict[str, FrontFilter] | None:
        """The continuous filter of full order, and the filter of low order for the sampled loop."""
        limits, loops = self.limits(reached), self.within(reached.share)
        try:
            full, fine = (
                full_order_filter(
                    loop, grid(loop), LaguerreBasis(loop, LAGUERRE_POLE), count, *limits
                )
                for loop, count in zip(loops.values(), COUNTS, strict=True)
            )
            sampled = loops["discrete"]
            few = low_order_filter(sampled, fine_grid(sampled), fine.F, self.order, *limits)
        except SolverError:  # no filter has this error with this little leakage
            return None
        return {"full": full, "discrete": few} if full.meets and few.meets else None

    reached = part(lambda chosen: chosen[0])
    designs = part(lambda chosen: chosen[1])
    demand_factor, set_share, allowed, leakage_allowed = reached_arrays(
        lambda self, reached: self.limits(reached)
    )

    # --- the front -----------------------------------------------------------------------------

    @array(dims=(kind, point, quantity), unit="1", meaning="front")
    def front(self, reached: DemandReached, context: Context) -> Any:
        basis = LaguerreBasis(self.loops["full"], LAGUERRE_POLE)
        fronts = self.fronts("full", reached.share)
        front = np.full((len(KINDS), len(ERRORS), 3), np.nan)
        for j, error in context.track(list(enumerate(ERRORS)), "front"):
            for i, each in enumerate(fronts):
                try:
                    point = each.least(basis.response(each.omega, CONTINUOUS), error)
                except SolverError:  # the basis has no filter for it: the front ends there
                    continue
                front[i, j] = point.error, point.leakage, point.noise
        return front

    @array(dims=point, unit="m", meaning="no filter leaks less in all")
    def least_total(self) -> list[float]:
        demands = self.loops["full"].demands
        return [least_total_error(demands, error, BOUND_CORNER) for error in ERRORS]

    @part
    def filters(
        self, reached: DemandReached, designs: dict[str, FrontFilter]
    ) -> dict[str, StateSpace]:
        """The robust filter and its peers, in continuous time."""
        peers = peer_filters(self.loops["full"], *self.limits(reached))
        return {"robust": designs["discrete"].F} | peers

    played = part(lambda filters: {k: bilinear_sampled(F, PERIOD) for k, F in filters.items()})
    filter = dim(lambda filters: list(filters))
    stored = system(design, called="{}")(
        lambda designs, played: {"full": designs["full"].F, "discrete": played["robust"]}
    )
    peak = array(
        dims=(design, requirement, bound),
        unit="1",
        meaning="certified bounds of mixed mu",
        value=lambda designs: [one.answer.peaks for one in designs.values()],
    )

    @array(dims=(filter, kind, quantity), unit="1")
    def judged(self, filters: dict[str, StateSpace], reached: DemandReached) -> Any:
        fronts = self.fronts("discrete", reached.share)
        return [
            [each.error_leakage_noise(each.estimate(F)) for each in fronts]
            for F in filters.values()
        ]

    shape = dim(SHAPES)
    seen = part(lambda: [sampled_defect(shape) for shape in SHAPES])
    time = dim(lambda seen: seen[0][0], unit="s")
    defect = array(
        dims=(shape, time), unit="m", meaning="", value=lambda seen: [defect for _, defect in seen]
    )

    @array(dims=(filter, shape, "drive", time), unit="m")
    def estimate(self, played: dict[str, StateSpace], context: Context) -> Any:
        every = [
            [estimates(self.axis, F, shape, self.delay, self.gain)[2] for shape in SHAPES]
            for F in context.track(list(played.values()), "defects")
        ]
        return np.array(every, np.float32)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        reached = reached_of(answer)
        loops, filters = self.within(reached.share), self.stored(answer)
        limits = self.limits(reached)
        return [
            demand_check(answer, limits),
            *filter_checks(self.axis, loops, filters, self.order, limits, answer),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        error, leakage, noise = answer["judged"].sel(filter="robust", kind=KINDS[1]).values.tolist()
        worst = answer["peak"].sel(bound="upper").max("requirement")
        found = {"fault_error": error, "leakage": leakage, "noise": 3 * noise}
        found |= in_metrics(answer, self.error, self.leakage)
        for name, K in self.stored(answer).items():
            found["peak" if name == "discrete" else "peak_full"] = float(worst.sel(design=name))
            found[f"order_{name}"] = float(K.nstates)
        for name in answer["filter"].values.tolist():
            end = "" if name == "robust" else f"_{name.replace('-', '_')}"
            for shape in SHAPES:
                errors = shape_errors(answer, name, shape)
                found[f"estimation_error_{identifier(shape)}{end}"] = float(errors.max())
        return found

    @table
    def fronts_and_filters(self, answer: Dataset) -> dict[str, Any]:
        """Table of the reached part of the demand, of the front, and of each filter's
        performance.
        """
        sizes = 1e6 * total(answer["front"])
        columns = zip(ERRORS, *sizes.values, 1e6 * answer["least_total"].values, strict=True)
        points = [
            [f"{error:.2f}", f"{nominal:.3f}", f"{bound:.3f}", _or_none(every)]
            for error, nominal, every, bound in columns
        ]
        filters = []
        for name in answer["filter"].values.tolist():
            judged = answer["judged"].sel(filter=name, kind=KINDS[1]).values * (1, 1e6, 3e6)
            errors = [f"{shape_errors(answer, name, shape).max():.2f}" for shape in SHAPES]
            filters.append([NAMES[name], *map("{:.3f}".format, judged), *errors])
        plants = ["nominal plant [um]", "no filter below [um]", "every plant [um]"]
        heads = ["filter", "error above 1.5 kHz", "leakage [um]", "3 rms [um]", *SHAPES]
        return {
            "demand": demand_table(answer, self.error, self.leakage),
            "front": (["relative error allowed", *plants], points),
            "filters": (heads, filters),
        }

    front_, figure_7_13 = figure(figures.front), figure(figures.defects)
    figure_7_12 = figure(lambda self, stored: figures.filters(self.axis, **stored))
    estimate_ = figure(
        lambda self, stored, set_share: figures.channel(
            self.within(float(set_share))["discrete"], stored["discrete"]
        )
    )


def _or_none(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "none found"
