"""Synthesis methods judged by one analysis: Table 5.1 in numbers (section 5.1).

Table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from workbench import Check, Run, problem
from workbench.arrays import RealArray, outward_single
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, StateSpace
from workbench.mu import Peak, conditions, performance_peak, performance_sweep
from workbench.structure import Full, Structure
from workbench.study import Study, array, check, dim, figure, metric, part, system, table
from workbench.study.declarations import identifier
from workbench.synthesis import DESIGNS, DesignTask
from workbench.synthesis.mu.program import PEAK_TOLERANCE
from workbench.systems.generalised_plant import response
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
"""Conditions of a peak; the last three are robust performance of z_p alone, and with a larger
uncertainty."""
LOW, HIGH = 1.0, 20e3
"""Ends of the frequencies shown [Hz]."""


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

    LQG, mixed sensitivity, loop shaping, H-infinity against a full block, D-K and (mu, D)-K
    iteration, beside the reference controller and one of its order that lowers mixed mu directly:
    nominal stability, and certified peaks of nominal performance, robust stability and robust
    performance of w_p to (z_p, z_u). Robust performance also with real scalars taken as complex
    and with all uncertainty as one full block, which is what the simpler methods can see.

    form: uncertainty for which controllers are made and judged. cover, gain: of the covers, as in
    cd/<axis>/mu-pid-analysis. frequencies: of covers and of the curves shown.
    """
    return Methods(axis, uncertainty(axis, covered), frequencies, tuple(DESIGNS))


@dataclass(frozen=True, eq=False)
class Methods(Study):
    """Controllers of one plant by several methods, and what they achieve."""

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
    def peaks(self, controllers: ControllersByName, context: Context) -> list[list[Peak]]:
        return [self._peaks(K) for K in context.track(list(controllers.values()), "judging")]

    peak = array(
        (design, condition, bound), "1", "certified bounds of the peak over all frequencies"
    )(lambda peaks: [[(each.lower, each.upper) for each in row] for row in peaks])
    peak_frequency = array((design, condition), "Hz")(
        lambda peaks: [[each.omega / (2 * np.pi) for each in row] for row in peaks]
    )
    pole = array(design, "rad/s", "largest real part of the nominal loop's")(
        lambda self, controllers: [rightmost_pole(self.task, K) for K in controllers.values()]
    )
    order = array(design, "1")(lambda controllers: [K.nstates for K in controllers.values()])

    @array((design, bound, frequency), "1", "mu of robust performance")
    def mu(self, controllers: ControllersByName, omega: RealArray) -> NDArray[np.float32]:
        curves = (performance_sweep(self.task.plant, K, omega) for K in controllers.values())
        return outward_single([(curve.lower, curve.upper) for curve in curves])

    @array((design, frequency), "1", "magnitude of the nominal sensitivity")
    def S(self, controllers: ControllersByName, omega: RealArray) -> list[RealArray]:
        G = response(self.task.G, omega)
        loops = ((G * response(K, omega))[:, 0, 0] for K in controllers.values())
        return [abs(1 / (1 + L)) for L in loops]

    permitted = array(frequency, "1", "1/|W_p|")(
        lambda self, omega: 1 / abs(response(self.task.W_S, omega)[:, 0, 0])
    )

    def structures(self) -> dict[str, Structure]:
        """Structures of the perturbation: as it is, with complex scalars, and as one full block."""
        structure = self.task.structure
        return {
            "robust performance": structure,
            "complex scalars": structure.complexified(),
            "full block": Structure([Full(structure.rows, structure.columns)]),
        }

    def _peaks(self, K: StateSpace) -> list[Peak]:
        """Peaks of all conditions; a controller that does not stabilise is its method's error."""
        plant = self.task.plant
        found = conditions(plant, K, tolerance=PEAK_TOLERANCE)
        assert found.nominal_performance is not None
        assert found.robust_stability is not None
        robust = {
            name: _robust(replace(plant, structure=structure), K)
            for name, structure in self.structures().items()
        }
        robust["disturbance alone"] = _robust(plant.channel("z_p"), K)
        robust["nominal performance"] = found.nominal_performance
        robust["robust stability"] = found.robust_stability
        return [robust[name] for name in CONDITIONS]

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


def _robust(plant: GeneralisedPlant, K: StateSpace) -> Peak:
    """Peak of robust performance of a loop that is known to be stable."""
    found = performance_peak(plant, K, PEAK_TOLERANCE)
    assert found is not None
    return found
