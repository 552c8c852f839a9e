"""Stadiums and controller chosen for the least mu: what the thesis left open (5.4.3).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from workbench import Check, Run, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.certify.stability import stability_of
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational, from_system
from workbench.fitting.storage import function, roots
from workbench.geometry.cover import CONTAINMENT_TOLERANCE
from workbench.heavy_types import DataArray, Dataset, Figure, StateSpace
from workbench.mu import performance_peak, performance_sweep
from workbench.solution import solve
from workbench.study import Study, figure, metric, table
from workbench.synthesis import ControlCover, MuSynthesis
from workbench.synthesis.mu.control_cover import Name
from workbench.synthesis.mu.program import PEAK_TOLERANCE
from workbench.systems.storage import restored, stored
from workbench.uncertainty import Responses, UncertaintyModel, contains
from workbench.uncertainty.covers.everywhere import containment_check

from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ...uncertainty.measured_drives import Order, measured_drives
from ..design import CoverMethod, synthesis_plant, uncertainty
from ..loop_weights import control_cover
from .report import cover_figures

STAGES = ("narrowest", "controller for it", "in turn", "together")
LAST = STAGES[-1]
PARTS = ("nominal", "W_c", "W_r")
"""Rational functions of an uncertainty model."""

OptimisedStep = tuple[str, float]
"""Parts that a step optimised, and the certified upper bound after it."""


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
    """The narrowest stadiums, their orientation limited where it is erratic."""
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

    A third-order controller and the stadiums' orientations and lengths are optimised in turn,
    about the nominal of the narrowest stadiums, from the reference controller; then these and the
    nominal together, again and again. Where that ends, a controller designed anew may lead on.

    cover, frequencies, gain: of the narrowest stadiums, as `cd/<axis>/stadium-cover`.
    complex_order: of the weight that is chosen for control. rounds: most of the alternation, of all
    together, and of controllers designed anew.
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
        order = None if K is None else K.nstates
        return MuSynthesis(synthesis_plant(self.axis, model), start=K, order=order)

    def compute(self, context: Context) -> Dataset:
        import control
        import xarray as xr

        first = self._stage(self.given, control.ss(controller(self.axis)))
        second = self._designed(first)
        steps = [("reference controller", first.peak), ("controller", second.peak)]
        cover = control_cover(self.axis, 1.0, self.responses, self.complex_order)
        third = self._in_turn(cover, second, steps, context)
        # A local search: what is best in turn may be a dead end for all together.
        ends = [self._together(cover, start, steps, context) for start in (third, second)]
        last = self._led_on(cover, min(ends, key=lambda each: each.peak), steps, context)
        stages = (first, second, third, last)
        omega = self.responses.omega
        curves, bounds = [], []
        variables: dict[str, Any] = {}
        for number, (one, used, _) in enumerate(stages):
            plant = synthesis_plant(self.axis, one)
            found = performance_sweep(plant, used, omega)
            curves.append([found.lower, found.upper])
            certified = performance_peak(plant, used, PEAK_TOLERANCE)
            assert certified is not None  # every stage has a finite peak
            bounds.append([certified.lower, certified.upper])
            variables |= stored(f"controller{number}", used)
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
                data = data.assign(roots(part, name, f"{name}{number}_"))
        return data

    def _in_turn(
        self, cover: ControlCover, best: DesignStage, steps: list[OptimisedStep], context: Context
    ) -> DesignStage:
        """Real weight and controller in turn, as long as the certified peak falls."""
        for _ in context.track(range(self.rounds), "in turn"):
            found = self._chosen(cover, best, ["real"], context)
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
        self, cover: ControlCover, best: DesignStage, steps: list[OptimisedStep], context: Context
    ) -> DesignStage:
        """Nominal, real weight and controller at once, as long as the certified peak falls."""
        for _ in range(self.rounds):
            found = self._chosen(cover, best, ["nominal", "real", "controller"], context)
            steps.append(("nominal, stadiums, controller", found.peak))
            if found.peak >= best.peak * (1 - PEAK_TOLERANCE):
                break
            best = found
        return best

    def _led_on(
        self, cover: ControlCover, best: DesignStage, steps: list[OptimisedStep], context: Context
    ) -> DesignStage:
        """A controller designed anew, then all together, as long as the certified peak falls."""
        for _ in context.track(range(self.rounds), "led on"):
            found = self._designed(best)
            steps.append(("controller", found.peak))
            found = self._together(cover, found, steps, context)
            if found.peak >= best.peak * (1 - PEAK_TOLERANCE):
                break
            best = found
        return best

    def _chosen(
        self, cover: ControlCover, stage: DesignStage, moving: Sequence[Name], context: Context
    ) -> DesignStage:
        """The best of the choices by its certified peak.

        A weight W_c is fitted only where mu with the radii that it must cover, at the frequencies
        of the cover, is below the best peak so far: a larger W_c does not lower mu.
        """
        assert stage.model.W_r is not None
        parts: dict[Name, Rational] = {
            "nominal": stage.model.nominal,
            "real": stage.model.W_r,
            "controller": from_system(stage.K),
        }
        choices = [(cover.least_peak(each), each) for each in cover.chosen(parts, moving, context)]
        best: DesignStage | None = None
        for least, each in sorted(choices, key=lambda choice: choice[0]):
            if best is not None and least >= best.peak:
                break
            K = stage.K if "controller" not in moving else each["controller"].state_space()
            found = self._stage(cover.model(each, context), K)
            best = found if best is None or found.peak < best.peak else best
        assert best is not None  # the first choice is always tried
        return best

    def _designed(self, stage: DesignStage) -> DesignStage:
        """The best controller of the same order that "fixed" finds from that of a stage or anew."""
        program = self.program(stage.model, stage.K)
        found, messages = [], []
        for each in (program, replace(program, start=None)):
            try:
                solution = solve(each, "fixed")
            except SolverError as error:
                messages.append(str(error))
                continue
            messages.append(solution.message)
            if solution.certificate is not None and solution.certificate.valid:
                found.append(DesignStage(stage.model, solution.answer.K, solution.answer.upper))
        if not found:
            raise SolverError(f"no controller for the stadiums: {'; '.join(messages)}")
        return min(found, key=lambda each: each.peak)

    def _stage(self, model: UncertaintyModel, K: StateSpace) -> DesignStage:
        return DesignStage(model, K, self._peak(model, K))

    def _peak(self, model: UncertaintyModel, K: StateSpace) -> float:
        """Certified upper bound; infinite where the loop is unstable."""
        certified = self.program(model, None).certified(K)
        return np.inf if certified is None else certified.upper

    def stage(self, answer: Dataset, number: int) -> tuple[UncertaintyModel, StateSpace]:
        """The model and controller of a stage."""
        nominal, W_c, W_r = (function(answer, f"{name}{number}_") for name in PARTS)
        return UncertaintyModel(nominal, W_c, W_r), restored(answer, f"controller{number}")

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
                    CONTAINMENT_TOLERANCE,
                    inside.where,
                    over=self.responses.over,
                )
            )
            everywhere = containment_check(model, self.responses)
            checks.append(replace(everywhere, name=f"{name}: {everywhere.name}"))
            stability = stability_of(synthesis_plant(self.axis, model).close(K))
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
    peak_controller_only = metric(lambda peak: peak.sel(stage="controller for it", bound="upper"))
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
