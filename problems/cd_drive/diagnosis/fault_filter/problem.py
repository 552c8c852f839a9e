"""The robust fault filter: how much of a defect is estimated, how much of the disc leaks in.

Section, figure and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003), section 7.2.1 and figures 7.8, 7.12 and 7.13. Its printed scalings allow u_f = 0;
here the two channels are the relative error of the estimate and the leakage in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.storage import function
from workbench.heavy_types import Dataset, Figure
from workbench.systems.storage import restored, stored
from workbench.uncertainty import UncertaintyModel

from ...control.cover_for_control.problem import PARTS, STAGES
from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES, Frequencies
from .bound import least_total
from .checks import filter_checks
from .defect_estimates import SHAPES, estimates, sampled_defect
from .design import few_states, full_order
from .front import FaultFront, laguerre
from .loop import FaultLoop, resampled
from .peers import peer_filters
from .report import filter_figures, filter_tables, shape_errors

ERRORS = (0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6)
"""Relative errors of the front."""
KINDS = ("nominal plant", "every plant")
CONTINUOUS, SAMPLED = 16, 20
"""Functions of the basis."""


def needs(axis: str = "focus", frequencies: int = 120, gain: Gain = "own", **_: Any) -> Any:
    """Stadiums that were chosen for control: around the narrowest no loop is robustly stable."""
    return {
        "covered": ref(f"cd/{axis}/cover-for-control", frequencies=frequencies, gain=gain),
    }


@problem("cd/focus/fault-filter", needs=needs, data=TABLES)
def fault_filter(
    covered: Run,
    frequencies: Frequencies = 120,
    gain: Gain = "own",
    error: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.3,
    leakage: Annotated[float, Field(gt=0.0, le=1e-4)] = 0.5e-6,
    order: Annotated[int, Field(ge=1, le=20)] = 10,
    delay: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0,
) -> FaultFilterStudy:
    """A filter that estimates surface defects on every drive, and leaves the disc's deviation out.

    The point chosen is where the front bends: below a relative error of 0.3 every plant's total
    rises steeply, by half for 0.05 less, above it falls by less than a third for 0.1 more; and
    there what the disc leaks is a quarter of the 2 um that the loop itself may be off.

    frequencies, gain: of the stadiums, as `cd/focus/cover-for-control`. error: relative, allowed
    from 1.5 kHz on; leakage: of the Red Book's envelope into the estimate [m], allowed up to
    200 Hz. order: of the sampled filter. delay: of the sampled loop [samples].
    """
    nominal, W_c, W_r = (function(covered.data, f"{name}{len(STAGES) - 1}_") for name in PARTS)
    model = UncertaintyModel(nominal, W_c, W_r)
    return FaultFilterStudy(model, error, leakage, order, delay)


@dataclass(frozen=True, eq=False)
class FaultFilterStudy(Study):
    """The front, filters at one of its points, and defects that they estimate."""

    model: UncertaintyModel
    error: float
    leakage: float
    order: int
    delay: float

    headline: ClassVar[str] = "leakage"

    @cached_property
    def loops(self) -> dict[str, FaultLoop]:
        """With the mu-PID of eq. 6.12: in continuous time, and as a computer closes it."""
        import control

        K = control.ss(controller("focus"))
        return {
            "full": FaultLoop("focus", self.model, K),
            "discrete": FaultLoop("focus", self.model, K, self.delay),
        }

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        loop, sampled = self.loops["full"], self.loops["discrete"]
        fronts = {name: FaultFront(loop, name == KINDS[0]) for name in KINDS}
        front = np.full((len(KINDS), len(ERRORS), 3), np.nan)
        bound = np.full(len(ERRORS), np.nan)
        for j, error in context.track(list(enumerate(ERRORS)), "front"):
            for i, each in enumerate(fronts.values()):
                try:
                    point = each.least(laguerre(loop, CONTINUOUS, each.omega), error)
                except SolverError:  # no filter of the basis: the front ends there
                    continue
                front[i, j] = point.error, point.leakage, point.noise
            bound[j] = least_total(loop, error)
        limits = self.error, self.leakage
        full = full_order(loop, CONTINUOUS, *limits)
        fine = full_order(sampled, SAMPLED, *limits)
        few = few_states(sampled, fine.F, self.order, *limits)
        filters = {"robust": few.F} | peer_filters(loop, *limits)
        judges = [FaultFront(sampled, name == KINDS[0]) for name in KINDS]
        judged = [[each.judged(each.estimate(F)) for each in judges] for F in filters.values()]
        played = {name: resampled(F) for name, F in filters.items()}
        shown = [sampled_defect(shape) for shape in SHAPES]
        runs = np.array(
            [
                [estimates("focus", F, shape, self.delay)[2] for shape in SHAPES]
                for F in context.track(list(played.values()), "defects")
            ]
        )
        metre, one = {"units": "m"}, {"units": "1"}
        data: dict[str, Any] = {
            "front": (("kind", "point", "quantity"), front, one | {"long_name": "front"}),
            "least_total": ("point", bound, metre | {"long_name": "no filter leaks less in all"}),
            "peak": (
                ("design", "requirement", "bound"),
                np.array([full.answer.peaks, few.answer.peaks]),
                one | {"long_name": "certified bounds of mixed mu"},
            ),
            "judged": (("filter", "kind", "quantity"), np.array(judged), one),
            "defect": (("shape", "time"), [seen for _, seen in shown], metre),
            "estimate": (("filter", "shape", "drive", "time"), runs, metre),
            **stored("full", full.F),
            **stored("discrete", played["robust"]),
        }
        return xr.Dataset(
            data,
            coords={
                "kind": list(KINDS),
                "point": ("point", list(ERRORS), one | {"long_name": "relative error allowed"}),
                "quantity": ["error", "leakage", "noise"],
                "design": ["full", "discrete"],
                "requirement": [each.name for each in loop.requirements(*limits)],
                "bound": ["lower", "upper"],
                "filter": list(filters),
                "shape": list(SHAPES),
                "time": ("time", shown[0][0], {"units": "s"}),
            },
        )

    # --- checks and metrics -------------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return filter_checks(self.loops, self.error, self.leakage, self.order, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        judged = answer["judged"].sel(filter="robust", kind=KINDS[1])
        full, few = (restored(answer, name) for name in ("full", "discrete"))
        worst = answer["peak"].sel(bound="upper").max("requirement")
        found = {
            "peak": float(worst.sel(design="discrete")),
            "peak_full": float(worst.sel(design="full")),
            "fault_error": float(judged.sel(quantity="error")),
            "leakage": float(judged.sel(quantity="leakage")),
            "noise": 3 * float(judged.sel(quantity="noise")),
            "order_full": float(full.nstates),
            "order_discrete": float(few.nstates),
        }
        for name in answer["filter"].values:
            end = "" if name == "robust" else f"_{str(name).replace('-', '_')}"
            for shape in SHAPES:
                errors = shape_errors(answer, str(name), shape)
                found[f"estimation_error_{shape.replace(' ', '_')}{end}"] = float(errors.max())
        return found

    def tables(self, answer: Dataset) -> dict[str, str]:
        return filter_tables(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return filter_figures(self.loops["discrete"], answer)
