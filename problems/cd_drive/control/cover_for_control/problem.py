"""Stadiums and controller chosen for the least mu, a question left open by the thesis (5.4.3).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from workbench import Check, Run, problem, ref, solve
from workbench.certificate import EVERY_PERTURBATION
from workbench.certify import stability_check
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting import Rational, rational_of_system, rational_variables, restored_rational
from workbench.mu import performance_peak, performance_sweep
from workbench.study import Study, figure, metric, table
from workbench.synthesis import PEAK_TOLERANCE, ControlCover, CoverPart, MuSynthesis
from workbench.systems import restored_system, stored_system
from workbench.types import DataArray, Dataset, Figure, StateSpace
from workbench.uncertainty import Responses, UncertaintyModel, containment_check, contains

from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ...uncertainty.measured_drives import Order, measured_drives
from ..design import CoverMethod, synthesis_plant, uncertainty
from ..loop_weights import control_cover
from .report import cover_figures

STAGES = ("narrowest", "controller for it", "in turn", "together")
CONTAINMENT_SLACK = 1e-9
"""Largest distance of a drive outside its stadium that counts as rounding, over the radius."""
LAST = STAGES[-1]
PARTS = ("nominal", "W_c", "W_r")
"""Rational functions of an uncertainty model."""

OptimisedStep = tuple[str, float]
"""Names of the parts that a step optimised, and the certified upper bound after it."""


class DesignStage(NamedTuple):
    """A model, a controller, and the certified upper bound of their peak; infinite if unstable."""

    model: UncertaintyModel
    K: StateSpace
    peak: float


def needs(
    axis: str,
    cover: CoverMethod = "steps",
    frequencies: int = 400,
    gain: Gain = "own",
    **_: Any,
) -> dict[str, Any]:
    """Reference to the narrowest stadiums, with orientations limited where they are erratic."""
    name = f"cd/{axis}/stadium-cover"
    return {"narrowest": ref(name, method=cover, frequencies=frequencies, gain=gain)}


@problem(
    "cd/{axis}/cover-for-control", slow=True, axis=("focus", "radial"), needs=needs, data=TABLES
)
def cover_for_control(
    axis: Axis,
    narrowest: Run,
    cover: CoverMethod = "steps",
    frequencies: Frequencies = 400,
    gain: Gain = "own",
    complex_order: Order = 6,
    rounds: Annotated[int, Field(ge=1, le=20)] = 4,
) -> CoverForControl:
    """How much lower the certified peak gets when stadiums are chosen for it, not for their width.

    First, a third-order controller and the stadiums' orientations and lengths are optimised in
    turn, about the nominal of the narrowest stadiums, from the controller designed for them. Then
    these and the nominal are optimised together, repeatedly, from that controller and from the
    reference controller. Each search is the best of several with nearby starts.

    cover, frequencies, gain: of the narrowest stadiums, as in `cd/<axis>/stadium-cover`.
    complex_order: order of the weight that is chosen for control. rounds: largest number of rounds,
    in turn and all together.
    """
    responses = measured_drives(axis, frequencies, 5.0, 5000.0, gain)
    return CoverForControl(axis, narrowest, responses, complex_order, rounds)


@dataclass(frozen=True, eq=False)
class CoverForControl(Study):
    """Certified peaks of the rounds, and the models and controllers of four stages."""

    axis: Axis
    narrowest: Run
    responses: Responses
    complex_order: int
    rounds: int

    headline: ClassVar[str] = "peak"

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    @cached_property
    def given(self) -> UncertaintyModel:
        """The model of the narrowest stadiums."""
        model = uncertainty(self.axis, self.narrowest)
        assert isinstance(model, UncertaintyModel) and model.W_r is not None
        return model

    def program(self, model: UncertaintyModel, K: StateSpace | None) -> MuSynthesis:
        return MuSynthesis(synthesis_plant(self.axis, model), start=K)

    def compute(self, context: Context) -> Dataset:
        import control
        import xarray as xr

        first = self._stage(self.given, control.ss(controller(self.axis)))
        second = self._designed(first)
        steps = [("reference controller", first.peak), ("controller", second.peak)]
        cover = control_cover(self.axis, 1.0, self.responses, self.complex_order)
        third = self._in_turn(cover, second, steps, context)
        # Searches are local: the best result in turn may be a dead end for the joint search, and so
        # may the controller for the narrowest stadiums.
        ends = [
            self._together(cover, stage, name, steps, context)
            for name, stage in zip(STAGES, (first, second), strict=False)
        ]
        last = min(*ends, third, key=lambda each: each.peak)
        stages = (first, second, third, last)
        omega = self.responses.omega
        curves, bounds = [], []
        variables: dict[str, Any] = {}
        for number, (one, used, _) in enumerate(stages):
            plant = synthesis_plant(self.axis, one)
            found = performance_sweep(plant, used, omega)
            curves.append([found.lower, found.upper])
            certified = performance_peak(plant, used, tolerance=PEAK_TOLERANCE)
            assert certified is not None  # every stage has a finite peak
            bounds.append([certified.lower, certified.upper])
            variables |= stored_system(f"controller{number}", used)
        unit = {"units": "1"}
        data = xr.Dataset(
            {
                "peak": (
                    ("stage", "bound"),
                    bounds,
                    unit | {"long_name": "certified bounds of the supremum of mu"},
                ),
                "mu": (
                    ("stage", "bound", "frequency"),
                    curves,
                    unit | {"long_name": "mu of robust performance"},
                ),
                "step_peak": (
                    "step",
                    [peak for _, peak in steps],
                    unit | {"long_name": "certified upper bound"},
                ),
                **variables,
            },
            coords={
                "stage": list(STAGES),
                "bound": ["lower", "upper"],
                "frequency": ("frequency", omega / 2 / np.pi, {"units": "Hz"}),
                "step": (
                    "step",
                    [what for what, _ in steps],
                    {"long_name": "what was optimised"},
                ),
            },
        )
        for number, (one, *_) in enumerate(stages):
            for name in PARTS:
                part = getattr(one, name)
                data = data.assign(rational_variables(part, name, prefix=f"{name}{number}_"))
        return data

    def _in_turn(
        self, cover: ControlCover, best: DesignStage, steps: list[OptimisedStep], context: Context
    ) -> DesignStage:
        """Optimise stadiums and controller in turn, as long as the certified peak falls."""
        for _ in context.track(range(self.rounds), "in turn"):
            found = self._lowered(cover, best, ["real"], context)
            steps.append(("stadiums", found.peak))
            if not np.isfinite(found.peak):
                break
            try:
                found = self._designed(found)
            except SolverError as error:
                steps.append((str(error), np.inf))
                break
            steps.append(("controller", found.peak))
            if found.peak >= best.peak * (1 - PEAK_TOLERANCE):
                break
            best = found
        return best

    def _together(
        self,
        cover: ControlCover,
        best: DesignStage,
        start: str,
        steps: list[OptimisedStep],
        context: Context,
    ) -> DesignStage:
        """Optimise nominal, stadiums and controller together, as long as the certified peak falls.

        At the end the controller alone is optimised for its certified peak.
        """
        for _ in range(self.rounds):
            found = self._lowered(cover, best, ["nominal", "real", "controller"], context)
            steps.append((f"all, from: {start}", found.peak))
            if found.peak >= best.peak * (1 - PEAK_TOLERANCE):
                break
            best = found
        last = self._designed(best)
        steps.append(("controller", last.peak))
        return min(best, last, key=lambda each: each.peak)

    def _lowered(
        self, cover: ControlCover, stage: DesignStage, moving: Sequence[CoverPart], context: Context
    ) -> DesignStage:
        """The stage after optimising the moving parts, together with W_c."""
        model = stage.model
        assert model.W_r is not None
        parts: dict[CoverPart, Rational] = {
            "nominal": model.nominal,
            "real": model.W_r,
            "controller": rational_of_system(stage.K),
        }
        if model is not self.given:  # W_c of the narrowest stadiums has another order
            parts["circular"] = model.W_c
        found = cover.optimised_parts(parts, moving, context)
        K = stage.K if "controller" not in moving else found["controller"].state_space()
        return self._stage(cover.model(found, context), K)

    def _designed(self, stage: DesignStage) -> DesignStage:
        """The controller of the same order that method "fixed" finds near that of a stage."""
        solution = solve(self.program(stage.model, stage.K), method="fixed")
        if solution.certificate is None or not solution.certificate.valid:
            raise SolverError(f"no controller for the stadiums: {solution.message}")
        return DesignStage(stage.model, solution.answer.K, solution.answer.upper)

    def _stage(self, model: UncertaintyModel, K: StateSpace) -> DesignStage:
        return DesignStage(model, K, self._peak(model, K))

    def _peak(self, model: UncertaintyModel, K: StateSpace) -> float:
        """Certified upper bound; infinite if the loop is unstable."""
        certified = self.program(model, None).certified_peak(K)
        return np.inf if certified is None else certified.upper

    def stage(self, answer: Dataset, number: int) -> tuple[UncertaintyModel, StateSpace]:
        """The model and controller of a stage."""
        nominal, W_c, W_r = (restored_rational(answer, prefix=f"{name}{number}_") for name in PARTS)
        return UncertaintyModel(nominal, W_c, W_r), restored_system(answer, f"controller{number}")

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        checks = []
        for number, name in enumerate(STAGES):
            model, K = self.stage(answer, number)
            inside = contains(model, self.responses)
            statement = "largest distance of a drive beyond its stadium, relative to the radius"
            title = f"{name}: containment"
            checks.append(
                Check(
                    title,
                    statement,
                    inside.worst,
                    CONTAINMENT_SLACK,
                    where=inside.where,
                    over=self.responses.over,
                )
            )
            everywhere = containment_check(model, self.responses)
            checks.append(replace(everywhere, name=f"{name}: {everywhere.name}"))
            stability = stability_check(synthesis_plant(self.axis, model).close(K))
            checks.append(replace(stability, name=f"{name}: {stability.name}"))
            bound = float(answer["peak"].sel(stage=name, bound="upper"))
            statement = "certified supremum of mu over the bound that is claimed, less 1"
            again = self._peak(model, K) / bound - 1
            checks.append(Check(f"{name}: peak", statement, again, PEAK_TOLERANCE))
        uppers = answer["peak"].sel(bound="upper").values
        for number, name in ((2, "in turn"), (3, "together")):
            statement = f"peak {name} over that of the stage before"
            value = float(uppers[number] / uppers[number - 1])
            checks.append(Check(f"{name}: lower", statement, value, 1.0))
        return checks

    peak = metric(lambda peak: peak.sel(stage=LAST, bound="upper"))
    peak_lower = metric(lambda peak: peak.sel(stage=LAST, bound="lower"))
    peak_in_turn = metric(lambda peak: peak.sel(stage="in turn", bound="upper"))
    peak_narrowest = metric(lambda peak: peak.sel(stage="narrowest", bound="upper"))
    peak_controller_only = metric(
        template=lambda peak: peak.sel(stage="controller for it", bound="upper")
    )
    order = metric(lambda controller3_A: len(controller3_A))
    iterations = metric(lambda step: step.size)

    @table
    def made(self, step: DataArray, step_peak: DataArray) -> dict[str, Any]:
        """Certified peaks step by step."""
        peaks = zip(step.values, step_peak.values, strict=True)
        rows = [[number, what, f"{peak:.4f}"] for number, (what, peak) in enumerate(peaks)]
        return {"rounds": (["step", "optimised", "certified peak"], rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        sizes = [self.stage(answer, number)[0].sizes(self.responses.omega) for number in (0, 3)]
        return cover_figures(self.axis, answer, sizes)
