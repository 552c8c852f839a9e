"""Synthesis methods judged by one analysis: Table 5.1 in numbers (section 5.1).

Table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import Peak, conditions, performance_peak, performance_sweep
from workbench.structure import Full, Structure
from workbench.synthesis import DESIGNS, DesignTask
from workbench.systems.generalised_plant import response
from workbench.systems.storage import restored, stored
from workbench.uncertainty import GeneralisedPlant, ParametricModel, UncertaintyModel

from ...drive.plants import Gain
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from ..design import Cover, Form, cover_of, uncertainty
from .checks import method_checks
from .designs import design_task
from .report import method_figures, method_tables

CONDITIONS = (
    "nominal performance",
    "robust stability",
    "robust performance",
    "disturbance alone",
    "complex scalars",
    "full block",
)
"""Of which the last three are robust performance: of z_p alone, and with a larger uncertainty."""
TOLERANCE = 1e-3
"""Of the certified peaks, relative."""
LOW, HIGH = 1.0, 20e3
"""Ends of the frequencies shown [Hz]."""


@problem("cd/{axis}/methods", axis=("focus", "radial"), needs=cover_of, data=TABLES, slow=True)
def methods(
    axis: Axis,
    covered: Run | None = None,
    form: Form = "parametric",
    cover: Cover = "steps",
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

    @cached_property
    def task(self) -> DesignTask:
        return design_task(self.axis, self.uncertain)

    @cached_property
    def frequency(self) -> RealArray:
        """Frequencies of the curves [Hz] (F,)."""
        return np.geomspace(LOW, HIGH, self.frequencies)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        task = self.task
        made = {name: DESIGNS[name](task, context) for name in self.names}
        judged = context.track(list(made.values()), "judging")
        found = [self._peaks(K) for K in judged]
        omega = 2 * np.pi * self.frequency
        one = {"units": "1"}
        weight = abs(response(task.W_S, omega)[:, 0, 0])
        return xr.Dataset(
            {
                "peak": (
                    ("design", "condition", "bound"),
                    [[(each.lower, each.upper) for each in row] for row in found],
                    one | {"long_name": "certified bounds of the peak over all frequencies"},
                ),
                "peak_frequency": (
                    ("design", "condition"),
                    [[each.omega / (2 * np.pi) for each in row] for row in found],
                    {"units": "Hz"},
                ),
                "pole": (
                    "design",
                    [self._pole(K) for K in made.values()],
                    {"units": "rad/s", "long_name": "largest real part of the nominal loop's"},
                ),
                "order": ("design", [K.nstates for K in made.values()], one),
                "mu": (
                    ("design", "bound", "frequency"),
                    [self._curve(K) for K in made.values()],
                    one | {"long_name": "mu of robust performance"},
                ),
                "S": (
                    ("design", "frequency"),
                    [self._sensitivity(K) for K in made.values()],
                    one | {"long_name": "magnitude of the nominal sensitivity"},
                ),
                "permitted": ("frequency", 1 / weight, one | {"long_name": "1/|W_p|"}),
                **{
                    key: value
                    for name, K in made.items()
                    for key, value in stored(_key(name), K).items()
                },
            },
            coords={
                "design": list(made),
                "condition": list(CONDITIONS),
                "bound": ["lower", "upper"],
                "frequency": (
                    "frequency",
                    self.frequency,
                    {"units": "Hz", "long_name": "frequency"},
                ),
            },
        )

    def controllers(self, answer: Dataset) -> dict[str, StateSpace]:
        """The controllers of an answer by method."""
        return {name: restored(answer, _key(name)) for name in answer["design"].values.tolist()}

    def structures(self) -> dict[str, Structure]:
        """Of the plant's perturbation: as it is, its scalars complex, one full block."""
        structure = self.task.structure
        return {
            "robust performance": structure,
            "complex scalars": structure.complexified(),
            "full block": Structure([Full(structure.rows, structure.columns)]),
        }

    def _peaks(self, K: StateSpace) -> list[Peak]:
        """Of every condition; a controller that does not stabilise is an error of its method."""
        plant = self.task.plant
        found = conditions(plant, K, tolerance=TOLERANCE)
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

    def _curve(self, K: StateSpace) -> RealArray:
        """Lower and upper bound of robust performance (2, F)."""
        found = performance_sweep(self.task.plant, K, 2 * np.pi * self.frequency)
        return np.array([found.lower, found.upper])

    def _sensitivity(self, K: StateSpace) -> RealArray:
        omega = 2 * np.pi * self.frequency
        L = response(self.task.G, omega) * response(K, omega)
        size: RealArray = abs(1 / (1 + L[:, 0, 0]))
        return size

    def _pole(self, K: StateSpace) -> float:
        """Of the loop of plant and controller alone; that of W_p is at -0.001 rad/s always."""
        import control

        return float(control.feedback(self.task.G * K, 1).poles().real.max())

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        controllers = self.controllers(answer)
        return method_checks(self.axis, self.uncertain, self.task, controllers, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        upper = answer["peak"].sel(bound="upper")
        numbers = {}
        for name in answer["design"].values.tolist():
            numbers[f"order_{_key(name)}"] = float(answer["order"].sel(design=name))
            for condition in CONDITIONS:
                short = "" if condition == "robust performance" else f"_{_key(condition)}"
                value = upper.sel(design=name, condition=condition)
                numbers[f"peak{short}_{_key(name)}"] = float(value)
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return method_tables(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return method_figures(self.axis, answer)


def _robust(plant: GeneralisedPlant, K: StateSpace) -> Peak:
    """Peak of robust performance of a loop that is known to be stable."""
    found = performance_peak(plant, K, TOLERANCE)
    assert found is not None
    return found


def _key(name: str) -> str:
    """A name as it stands in names of variables and metrics."""
    parts = "".join(letter if letter.isalnum() else " " for letter in name.lower()).split()
    return "_".join(parts)
