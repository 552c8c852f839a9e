"""Robust performance at five times the disc's nominal speed (section 6.3.2, figure 6.5).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, get_args

import numpy as np

from workbench import Check, Run, Study
from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import sweep
from workbench.synthesis import approximated
from workbench.synthesis.implementation.reduction import ReductionMethod
from workbench.systems.storage import restored, stored
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel
from workbench.uncertainty.covers.storage import shape

from ...drive.plants import controller
from ...drive.tables import Axis
from ..control_problem import generalised
from ..design import synthesis_plant, uncertainty
from ..equal_channels import MOST_GAIN, equalising_gain, performance_peak
from ..least_mu import least_mu
from .bounds import BOUNDED, lower_bounds
from .checks import five_x_checks
from .report import conclusions_table, figure_6_5, peaks_table
from .uncertain_loop import SPEED, UncertainLoop

ORDER = 9
"""Of the controller that the thesis shows, reduced from its 74th."""
CHANNELS: dict[str, tuple[Any, Any]] = {
    "disturbance": ("z_p", "w_p"),
    "control": ("z_u", "w_u"),
    "both": (("z_p", "z_u"), "w_p"),
}
"""Performance outputs and exogenous inputs; w_p and w_u enter the loop at one place."""
CONTROLLERS = ("mu-PID", "adjusted mu-PID", "full order", "ninth order")
FREQUENCIES = np.geomspace(1.0, 5e4, 240)
"""Of the curves [Hz], beside those of the cover."""
TOLERANCE = 1e-3
"""Of certified peaks, relative."""


@dataclass(frozen=True, eq=False)
class FiveX(Study):
    """Peaks and curves of four controllers, and bounds that hold for all."""

    axis: Axis
    covered: Run
    designed: Run

    headline: ClassVar[str] = "least_possible"

    @cached_property
    def loop(self) -> UncertainLoop:
        """The axis with the plants that the cover describes."""
        model = uncertainty(self.axis, self.covered)
        assert isinstance(model, UncertaintyModel)
        return UncertainLoop(self.axis, model)

    def controllers(self, answer: Dataset) -> dict[str, Any]:
        """The four, by the names of CONTROLLERS."""
        K = controller(self.axis)
        full = restored(self.designed.data, "controller")
        found = (K, float(answer["adjusted_gain"]) * K, full, restored(answer, "ninth"))
        return dict(zip(CONTROLLERS, found, strict=True))

    # --- arrays -------------------------------------------------------------------------------

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        one = {"units": "1"}
        whole = generalised(self.axis, self.loop.model, SPEED)
        plants = {name: whole.channel(*signals) for name, signals in CHANNELS.items()}
        gain = equalising_gain([plants["disturbance"], plants["control"]], controller(self.axis))
        if np.isnan(gain):
            raise SolverError(f"no gain up to {MOST_GAIN:g} makes both channels equally bad")
        reductions = self._reductions(plants["both"])
        ninth, top = min(reductions.values(), key=lambda each: each[1])
        if top == np.inf:
            raise SolverError(f"no reduction to order {ORDER} stabilises the loop")
        data = xr.Dataset(
            {
                "adjusted_gain": ((), gain, one | {"long_name": "gain of equal channels"}),
                "reduction_peak": (
                    "reduction",
                    [upper for _, upper in reductions.values()],
                    one | {"long_name": f"peak of mu at order {ORDER}, infinite: unstable"},
                ),
                **stored("ninth", ninth),
            },
            coords={"reduction": list(reductions)},
        )
        known = self.covered.data["frequency"].values
        frequency = np.unique(np.concatenate([known, FREQUENCIES]))
        omega = 2 * np.pi * frequency
        cases = self.controllers(data)
        found = {
            name: [_numbers(plants[channel], K, omega) for channel in CHANNELS]
            for name, K in context.track(list(cases.items()), "controllers")
        }
        peaks = np.array([[peak for peak, _ in row] for row in found.values()])
        curves = np.array([[curve for _, curve in row] for row in found.values()])
        least = [least_mu(self.loop.weights(omega, channel)) for channel in BOUNDED]
        narrow = shape(self.covered.data, "second")
        alone = replace(
            self.loop.weights(2 * np.pi * known),
            circular=narrow.radius,
            real=narrow.half_length * np.exp(1j * narrow.angle),
        )
        names = ("controller", "channel")
        mu = {"units": "1", "long_name": "mu of robust performance"}
        data = data.assign(
            peak=((*names, "bound"), peaks[..., :2], one | {"long_name": "certified bounds"}),
            peak_frequency=(names, peaks[..., 2], {"units": "Hz", "long_name": "of the peak"}),
            mu=((*names, "bound", "frequency"), curves, mu),
            least_mu=(
                ("bounded", "bound", "frequency"),
                [[each.lower, each.upper] for each in least],
                one | {"long_name": "least mu over all K at the frequency"},
            ),
            sets_least_mu=(
                "cover_frequency",
                least_mu(alone).lower,
                one | {"long_name": "least mu over all K, stadiums without fitted weights"},
            ),
        )
        data = data.assign_coords(
            controller=list(CONTROLLERS),
            channel=list(CHANNELS),
            bound=["lower", "upper"],
            bounded=list(BOUNDED),
            frequency=("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
            cover_frequency=("cover_frequency", known, {"units": "Hz"}),
        )
        best = float(np.nanmin(peaks[:, -1, 1]))
        return data.assign(lower_bounds(self.loop, omega, best, context))

    def _reductions(self, both: GeneralisedPlant) -> dict[str, tuple[StateSpace, float]]:
        """The designed controller reduced in every way, and its peak, infinite if unstable."""
        full = restored(self.designed.data, "controller")
        plant = synthesis_plant(self.axis, self.loop.model, SPEED)
        found = {}
        for method in get_args(ReductionMethod):
            K = approximated(full, ORDER, method, plant if method == "weighted" else None)
            top = performance_peak(both, K, TOLERANCE)
            found[method] = K, top.upper if top else np.inf
        return found

    # --- what is said of them -----------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return five_x_checks(self.loop, self.controllers(answer), answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        short = dict(zip(CONTROLLERS, ("mu_pid", "adjusted", "full", "ninth"), strict=True))
        upper = answer["peak"].sel(bound="upper")
        for name, key in short.items():
            for channel in CHANNELS:
                end = "" if channel == "both" else f"_{channel}"
                at = {"controller": name, "channel": channel}
                numbers[f"peak_{key}{end}"] = float(upper.sel(at))
        levels = answer["proven_level"]
        proven = {name: float(levels.sel(proof=name)) for name in self.loop.sets}
        pointwise = answer["pointwise_bound"].sel
        numbers |= {
            "adjusted_gain": float(answer["adjusted_gain"]),
            "order_full": float(self.designed.data["controller_A"].shape[0]),
            "nominal_bound": proven["nominal"],
            "nominal_norm": float(answer["nominal_norm"]),
            "pointwise_bound": float(pointwise(bounded="both")),
            "pointwise_bound_disturbance": float(pointwise(bounded="disturbance")),
            "pointwise_frequency": float(answer["pointwise_frequency"].sel(bounded="both")),
            "pointwise_bound_1X": float(answer["pointwise_bound_1X"]),
            "pointwise_bound_sets": float(answer["sets_least_mu"].max()),
            "dynamic_bound": proven["dynamic"],
        }
        bounds = [numbers["pointwise_bound"], *proven.values()]
        numbers["least_possible"] = float(np.nanmax(bounds))
        numbers["least_reached"] = float(upper.sel(channel="both").min())
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        numbers = self.metrics(answer)
        return {"peaks": peaks_table(answer), "conclusions": conclusions_table(self.axis, numbers)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"figure-6-5": figure_6_5(self.axis, answer)}


def _numbers(
    plant: GeneralisedPlant, K: StateSpace, omega: RealArray
) -> tuple[list[float], RealArray]:
    """Bounds of the peak, its frequency [Hz], and bounds of the curve (2, F); NaN: unstable."""
    found = performance_peak(plant, K, TOLERANCE)
    if found is None:
        return [np.nan] * 3, np.full((2, len(omega)), np.nan)
    assert plant.structure is not None
    whole = plant.structure.with_performance(plant.performance, plant.exogenous)
    curve = sweep(plant.close(K), whole, omega)
    numbers = [found.lower, found.upper, found.omega / (2 * np.pi)]
    return numbers, np.array([curve.lower, curve.upper])
