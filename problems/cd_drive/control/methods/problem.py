"""Synthesis methods compared by one analysis: Table 5.1 in numbers (section 5.1).

Table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from workbench import Check, Run, problem
from workbench.executor import Context
from workbench.mu import (
    Peak,
    PeakChecker,
    condition_systems,
    conditions,
    peak,
    performance_sweep,
)
from workbench.structure import Full, Structure
from workbench.study import (
    Study,
    answers,
    array,
    check,
    dim,
    figure,
    identifier,
    metric,
    part,
    single_precision_bounds,
    system,
    table,
)
from workbench.synthesis import DESIGNS, PEAK_TOLERANCE, DesignTask
from workbench.systems import response
from workbench.types import DataArray, Dataset, RealArray, StateSpace
from workbench.uncertainty import GeneralisedPlant, ParametricModel, UncertaintyModel

from ...drive.plants import Gain
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..design import CoverMethod, UncertaintyForm, cover_of, uncertainty
from .checks import ControllersByName, method_checks, rightmost_pole
from .designs import design_task
from .report import (
    claims_table,
    methods_table,
    mu_figure,
    sensitivity_figure,
    uncertainty_table,
)

CONDITIONS = (
    "nominal performance",
    "robust stability",
    "robust performance",
    "disturbance alone",
    "complex scalars",
    "full block",
)
"""Conditions that have a peak. The last three are robust performance of z_p alone, and with two
larger uncertainties.
"""
LOW, HIGH = 1.0, 20e3
"""Ends of the frequency range shown [Hz]."""
Questions = dict[tuple[str, str], tuple[StateSpace, Structure]]
"""System that a perturbation closes, and the perturbation's structure, by design and condition."""


@problem("cd/{axis}/methods", axis=("focus", "radial"), needs=cover_of, data=TABLES, slow=True)
def methods(
    axis: Axis,
    covered: Run | None = None,
    form: UncertaintyForm = "parametric",
    cover: CoverMethod = "steps",
    frequencies: Annotated[int, Field(ge=20, le=100_000)] = 400,
    gain: Gain = "own",
) -> Methods:
    """The synthesis methods of Table 5.1 on one plant, judged by the same certified analysis.

    The methods are LQG, mixed sensitivity, loop shaping, H-infinity against a full block, D-K and
    (mu, D)-K iteration, and for comparison the reference controller and one of its order that
    lowers mixed mu directly. Judged are nominal stability, and certified peaks of nominal
    performance, robust stability and robust performance from w_p to (z_p, z_u). Robust performance
    is also judged with real scalars taken as complex and with all uncertainty as one full block,
    since the simpler methods cannot use more structure.

    form: uncertainty for which controllers are made and judged. cover, gain: of the covers, as in
    cd/<axis>/mu-pid-analysis. frequencies: of the covers and of the curves shown.
    """
    return Methods(axis, uncertainty(axis, covered), frequencies, tuple(DESIGNS))


@dataclass(frozen=True, eq=False)
class Methods(Study):
    """Controllers of one plant by several methods, and their performance."""

    axis: Axis
    uncertain: UncertaintyModel | ParametricModel
    frequencies: int
    names: tuple[str, ...]

    headline: ClassVar[str] = "peak_mu_d_k"

    @property
    def quantifier(self) -> str:
        return "for these controllers"

    @cached_property
    def task(self) -> DesignTask:
        return design_task(self.axis, self.uncertain)

    design, condition = dim(lambda self: self.names), dim(CONDITIONS)
    bound = dim("lower", "upper")
    frequency = dim(
        lambda self: np.geomspace(LOW, HIGH, self.frequencies), unit="Hz", meaning="frequency"
    )
    omega = part(lambda frequency: 2 * np.pi * frequency.values)

    @system(design, called="{}")
    def controllers(self, context: Context) -> dict[str, StateSpace]:
        return {name: DESIGNS[name](self.task, context) for name in self.names}

    @part
    def questions(self, controllers: ControllersByName) -> Questions:
        """System that a perturbation closes, and the perturbation's structure, by design and
        condition.
        """
        return {
            (design, condition): question
            for design, K in controllers.items()
            for condition, question in self._questions(K).items()
        }

    @answers
    def peaks(
        self, questions: Questions, controllers: ControllersByName, context: Context
    ) -> dict[tuple[str, str], Peak | None]:
        """Peaks; a controller that does not stabilise is an error of its method."""
        found: dict[tuple[str, str], Peak | None] = {}
        for design in context.track(list(controllers), "judging"):
            judged = conditions(self.task.plant, controllers[design], tolerance=PEAK_TOLERANCE)
            for name in CONDITIONS:
                known = getattr(judged, name.replace(" ", "_"), None)
                found[design, name] = known or peak(
                    *questions[design, name], tolerance=PEAK_TOLERANCE
                )
        return found

    @peaks.checkers
    def of_the_questions(self, questions: Questions) -> dict[tuple[str, str], PeakChecker]:
        """Checker that certifies each peak."""
        return {case: PeakChecker(*question) for case, question in questions.items()}

    peak = array(
        dims=(design, condition, bound),
        unit="1",
        meaning="certified bounds of the peak over all frequencies",
    )(lambda peaks: by_design([(each.lower, each.upper) for each in peaks.values()]))
    peak_frequency = array(dims=(design, condition), unit="Hz")(
        lambda peaks: by_design([each.omega / (2 * np.pi) for each in peaks.values()])
    )
    pole = array(dims=design, unit="rad/s", meaning="largest real part of the nominal loop's")(
        lambda self, controllers: [rightmost_pole(self.task, K) for K in controllers.values()]
    )
    order = array(dims=design, unit="1")(
        lambda controllers: [K.nstates for K in controllers.values()]
    )

    @array(dims=(design, bound, frequency), unit="1", meaning="mu of robust performance")
    def mu(self, controllers: ControllersByName, omega: RealArray) -> NDArray[np.float32]:
        curves = (performance_sweep(self.task.plant, K, omega) for K in controllers.values())
        return single_precision_bounds([(curve.lower, curve.upper) for curve in curves])

    @array(dims=(design, frequency), unit="1", meaning="magnitude of the nominal sensitivity")
    def S(self, controllers: ControllersByName, omega: RealArray) -> list[RealArray]:
        G = response(self.task.nominal, omega)
        loops = ((G * response(K, omega))[:, 0, 0] for K in controllers.values())
        return [abs(1 / (1 + L)) for L in loops]

    permitted = array(dims=frequency, unit="1", meaning="1/|W_p|")(
        lambda self, omega: 1 / abs(response(self.task.W_S, omega)[:, 0, 0])
    )

    def structures(self) -> dict[str, Structure]:
        """Structures of the perturbation: the given one, one with complex scalars, and one full
        block.
        """
        structure = self.task.structure
        return {
            "robust performance": structure,
            "complex scalars": structure.complexified(),
            "full block": Structure([Full(structure.rows, structure.columns)]),
        }

    def _questions(self, K: StateSpace) -> dict[str, tuple[StateSpace, Structure]]:
        """The systems and structures of all conditions."""
        plant = self.task.plant
        of_plant = condition_systems(plant, K)
        found = {name: of_plant[name.replace(" ", "_")] for name in CONDITIONS[:2]}
        found |= {
            name: robust_performance_question(replace(plant, structure=structure), K)
            for name, structure in self.structures().items()
        }
        found["disturbance alone"] = robust_performance_question(
            plant.channel(performance="z_p"), K
        )
        return {name: found[name] for name in CONDITIONS}

    @check()
    def methods_judged(self, answer: Dataset) -> list[Check]:
        return method_checks(self.axis, self.uncertain, self.task, self.controllers(answer), answer)

    @metric
    def orders_and_peaks(self, peak: DataArray, order: DataArray) -> dict[str, float]:
        numbers = {}
        for name in self.names:
            key = identifier(name)
            numbers[f"order_{key}"] = float(order.sel(design=name))
            for condition in CONDITIONS:
                short = "" if condition == "robust performance" else f"_{identifier(condition)}"
                value = peak.sel(design=name, condition=condition, bound="upper")
                numbers[f"peak{short}_{key}"] = float(value)
        return numbers

    methods = table(lambda answer: methods_table(answer))
    uncertainty = table(lambda peak: uncertainty_table(peak))
    claims = table(lambda peak: claims_table(peak))
    mu_figure = figure(lambda self, answer: {"mu": mu_figure(self.axis, answer)})
    sensitivity = figure(lambda self, answer: sensitivity_figure(self.axis, answer))


def robust_performance_question(
    plant: GeneralisedPlant, K: StateSpace
) -> tuple[StateSpace, Structure]:
    """System and structure of robust performance."""
    return plant.close(K), plant.performance_structure


def by_design(values: Sequence[Any]) -> RealArray:
    """Values of all designs and conditions, with an axis for each."""
    found = np.array(values)
    return found.reshape(-1, len(CONDITIONS), *found.shape[1:])
