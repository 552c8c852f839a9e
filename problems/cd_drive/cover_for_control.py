"""Stadiums and controller chosen in turn for the least mu: what the thesis left open (5.4.3).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.storage import function, roots
from workbench.mu import peak, sweep
from workbench.program import solve
from workbench.synthesis import MuSynthesis
from workbench.synthesis.loops import restored, stability_of, stored
from workbench.uncertainty import Responses, UncertaintyModel, contains
from workbench.uncertainty.model import ROUNDING

from .control_cover import ControlCover
from .cover_for_control_report import cover_figures, rounds_table
from .covers import Order, measured_drives
from .design import Cover, synthesis_plant, uncertainty
from .drives import Gain, controller
from .sets import TABLES, Frequencies
from .tables import Axis

if TYPE_CHECKING:
    import xarray as xr
    from control import StateSpace
    from matplotlib.figure import Figure

STAGES = ("narrowest", "controller for it", "in turn")
TOLERANCE = 1e-3
"""Of certified peaks, relative, as of `MuSynthesis`."""
PARTS = ("nominal", "W_c", "W_r")


def needs(
    axis: str,
    cover: Cover = "steps",
    frequencies: int = 400,
    gain: Gain = "own",
    **_: Any,
) -> dict[str, Any]:
    """The narrowest stadiums, their orientation limited where it is erratic."""
    name = f"cd/{axis}/stadium-cover"
    return {"narrowest": ref(name, method=cover, frequencies=frequencies, gain=gain)}


@problem("cd/{axis}/cover-for-control", axis=("focus", "radial"), needs=needs, data=TABLES)
def cover_for_control(
    axis: Axis,
    narrowest: Run,
    cover: Cover = "steps",
    frequencies: Frequencies = 400,
    gain: Gain = "own",
    complex_order: Order = 6,
    rounds: Annotated[int, Field(ge=1, le=20)] = 4,
) -> CoverForControl:
    """How much lower the certified peak gets when stadiums are chosen for it, not for their width.

    A third-order controller and the stadiums' orientations and lengths are optimised in turn,
    about the nominal of the narrowest stadiums, from the reference controller.

    cover, frequencies, gain: of the narrowest stadiums, as `cd/<axis>/stadium-cover`.
    complex_order: of the weight that is chosen for control. rounds: of the alternation.
    """
    responses = measured_drives(axis, frequencies, 5.0, 5000.0, gain)
    return CoverForControl(axis, narrowest, responses, complex_order, rounds)


@dataclass(frozen=True, eq=False)
class CoverForControl(Study):
    """Certified peaks of the rounds, and the models and controllers of three stages."""

    axis: Axis
    narrowest: Run
    responses: Responses
    complex_order: int
    rounds: int

    headline: ClassVar[str] = "peak"

    @cached_property
    def given(self) -> UncertaintyModel:
        """The model of the narrowest stadiums."""
        model = uncertainty(self.axis, self.narrowest)
        assert isinstance(model, UncertaintyModel) and model.W_r is not None
        return model

    def program(self, model: UncertaintyModel, K: StateSpace | None) -> MuSynthesis:
        return MuSynthesis(synthesis_plant(self.axis, model), start=K)

    def compute(self, context: Context) -> xr.Dataset:
        import control
        import xarray as xr

        reference = control.ss(controller(self.axis))
        first = self._designed(self.given, reference)
        stages = {
            "narrowest": (self.given, reference),
            "controller for it": (self.given, first),
        }
        cover = ControlCover(self.axis, 1.0, self.responses, self.given.nominal, self.complex_order)
        peaks = [self._peak(*stages["narrowest"]), self._peak(*stages["controller for it"])]
        what = ["reference controller", "controller"]
        best = stages["controller for it"]
        model, K = best
        for _ in context.track(range(self.rounds), "in turn"):
            assert model.W_r is not None
            model = cover.model(K, model.W_r, context)
            peaks.append(self._peak(model, K))
            what.append("stadiums")
            if not np.isfinite(peaks[-1]):
                break
            K = self._designed(model, K)
            peaks.append(self._peak(model, K))
            what.append("controller")
            if peaks[-1] < self._peak(*best) * (1 - TOLERANCE):
                best = model, K
            else:
                break
        stages["in turn"] = best
        omega = self.responses.omega
        curves = []
        bounds = []
        variables: dict[str, Any] = {}
        for number, (one, used) in enumerate(stages.values()):
            plant = synthesis_plant(self.axis, one)
            assert plant.structure is not None
            whole = plant.structure.with_performance(plant.performance, plant.exogenous)
            loop = plant.close(used)
            found = sweep(loop, whole, omega)
            curves.append([found.lower, found.upper])
            certified = peak(loop, whole, TOLERANCE)
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
                "step_peak": ("step", peaks, unit | {"long_name": "certified upper bound"}),
                **variables,
            },
            coords={
                "stage": list(STAGES),
                "bound": ["lower", "upper"],
                "frequency": ("frequency", omega / 2 / np.pi, {"units": "Hz"}),
                "step": ("step", what, {"long_name": "what was optimised"}),
            },
        )
        for number, (one, _) in enumerate(stages.values()):
            for name in PARTS:
                part = getattr(one, name)
                data = data.assign(roots(part, name, f"{name}{number}_"))
        return data

    def _designed(self, model: UncertaintyModel, K: StateSpace) -> StateSpace:
        """The controller of K's order that method "fixed" finds near it."""
        solution = solve(self.program(model, K), "fixed")
        if solution.certificate is None or not solution.certificate.valid:
            raise SolverError(f"no controller for the stadiums: {solution.message}")
        found: StateSpace = solution.answer.K
        return found

    def _peak(self, model: UncertaintyModel, K: StateSpace) -> float:
        """Certified upper bound; infinite where the loop is unstable."""
        certified = self.program(model, None).certified(K)
        return np.inf if certified is None else certified.upper

    def stage(self, answer: xr.Dataset, number: int) -> tuple[UncertaintyModel, StateSpace]:
        """The model and controller of a stage."""
        nominal, W_c, W_r = (function(answer, f"{name}{number}_") for name in PARTS)
        return UncertaintyModel(nominal, W_c, W_r), restored(answer, f"controller{number}")

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        checks = []
        for number, name in enumerate(STAGES):
            model, K = self.stage(answer, number)
            inside = contains(model, self.responses)
            statement = "largest distance of a drive beyond its stadium, relative to the radius"
            checks.append(
                Check(f"{name}: containment", statement, inside.worst, ROUNDING, inside.where)
            )
            loop = synthesis_plant(self.axis, model).close(K)
            stability = stability_of(loop)
            checks.append(
                Check(f"{name}: {stability.name}", stability.statement, stability.value,
                      stability.limit, stability.where)
            )  # fmt: skip
            bound = float(answer["peak"].sel(stage=name, bound="upper"))
            statement = "certified supremum of mu over the bound that is claimed, less 1"
            again = self._peak(model, K) / bound - 1
            checks.append(Check(f"{name}: peak", statement, again, TOLERANCE))
        uppers = answer["peak"].sel(bound="upper").values
        statement = "peak in turn over that of the narrowest stadiums with a controller for them"
        checks.append(Check("lower", statement, float(uppers[2] / uppers[1]), 1.0))
        return checks

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
        upper = answer["peak"].sel(bound="upper")
        K = restored(answer, "controller2")
        return {
            "peak": float(upper.sel(stage="in turn")),
            "peak_lower": float(answer["peak"].sel(stage="in turn", bound="lower")),
            "peak_narrowest": float(upper.sel(stage="narrowest")),
            "peak_controller_only": float(upper.sel(stage="controller for it")),
            "order": float(K.nstates),
            "iterations": float(answer.sizes["step"]),
        }

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        return {"rounds": rounds_table(answer)}

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        sizes = [self.stage(answer, number)[0].sizes(self.responses.omega) for number in (0, 2)]
        return cover_figures(self.axis, answer, sizes)
