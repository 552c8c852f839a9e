"""Every controller at 1X by the same certified analysis, and what none can beat (figure 6.4).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, Study, problem, ref
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.mu import performance_peak, performance_sweep
from workbench.synthesis import largest_least_mu, least_mu
from workbench.systems.storage import restored
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel

from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ..control_problem import generalised
from ..design import cover_of, uncertainty
from ..five_x.study import CHANNELS
from ..loop_weights import loop_weights
from .report import figure_6_4, peaks_table

DESIGNS = {
    "third order": ("fixed", "reference"),
    "D-K": ("dk", ""),
    "(mu, D)-K": ("mu-dk", ""),
    "(D, G)-K": ("dgk", ""),
}
"""Method, and where it starts."""
MODELS = {
    "parametric": ("parametric", "steps", tuple(DESIGNS)),
    "circle": ("circle", "steps", ("third order", "D-K")),
    "circle, joint nominal": ("circle", "joint", ("D-K",)),
    "stadium": ("stadium", "steps", tuple(DESIGNS)),
}
"""Form of the uncertainty, method of its cover, and designs: circles have no real scalar, and the
reference controller does not stabilise the jointly chosen nominal."""
CONTROLLERS = ("mu-PID", *DESIGNS)
FREQUENCIES = np.geomspace(1.0, 5e4, 240)
"""Of the curves [Hz]."""
TOLERANCE = 1e-3
"""Of certified peaks, relative."""


def needs(axis: str, frequencies: int = 400, gain: Gain = "own", **_: Any) -> dict[str, Any]:
    """The covers, and a controller of every design for every model."""
    found: dict[str, Any] = {"covers": [], "designed": []}
    for form, cover, designs in MODELS.values():
        choice: Any = {"form": form, "cover": cover, "frequencies": frequencies, "gain": gain}
        found["covers"] += cover_of(axis, **choice).values()
        found["designed"] += [
            ref(f"cd/{axis}/controller", method=method, after=after, **choice)
            for method, after in (DESIGNS[name] for name in designs)
        ]
    return found


@problem("cd/{axis}/controllers", axis=("focus", "radial"), needs=needs, data=TABLES, slow=True)
def controllers(  # type: ignore[no-untyped-def]
    axis: Axis,
    covers,
    designed,
    frequencies: Frequencies = 400,
    gain: Gain = "own",
) -> Controllers:
    """The controllers of every method and form of uncertainty beside the mu-PID (figure 6.4).

    Certified peaks at 1X of w_p -> z_p, of w_u -> z_u and of both, each with the uncertainty that
    the controller was made for. For circles and stadiums the least mu that any controller leaves at
    a frequency, and for circles what a nominal chosen jointly with them changes.

    frequencies: how many the covers are made on, from 5 Hz to 5 kHz. gain: of the twelve drives.
    """
    return Controllers(axis, covers, designed)


@dataclass(frozen=True, eq=False)
class Controllers(Study):
    """Peaks and curves of four controllers with four models."""

    axis: Axis
    covers: Sequence[Run]
    designed: Sequence[Run]

    headline: ClassVar[str] = "peak_parametric"

    def plant(self, model: int) -> GeneralisedPlant:
        """(w_p, w_u) to (z_p, z_u) without noise; the parametric model has no cover."""
        covered = self.covers[model - 1] if model else None
        return generalised(self.axis, uncertainty(self.axis, covered))

    def compute(self, context: Context) -> Dataset:
        import control
        import xarray as xr

        omega = 2 * np.pi * FREQUENCIES
        shape = len(MODELS), len(CONTROLLERS), len(CHANNELS)
        peaks, curves = np.full((*shape, 2), np.nan), np.full((*shape, 2, len(omega)), np.nan)
        orders = np.full(shape[:2], np.nan)
        least, bounds = (
            np.full((len(MODELS), len(omega)), np.nan),
            np.full((len(MODELS), 2), np.nan),
        )
        runs = iter(self.designed)
        for m, (_, _, designs) in enumerate(context.track(list(MODELS.values()), "models")):
            whole = self.plant(m)
            used = {"mu-PID": control.ss(controller(self.axis))}
            for name in designs:
                used[name] = restored(next(runs).data, "controller")
            for name, K in used.items():
                k = CONTROLLERS.index(name)
                orders[m, k] = K.nstates
                for c, (performance, exogenous) in enumerate(CHANNELS.values()):
                    plant = whole.channel(performance, exogenous)
                    found = performance_peak(plant, K, TOLERANCE)
                    if found is None:
                        continue
                    peaks[m, k, c] = found.lower, found.upper
                    curve = performance_sweep(plant, K, omega)
                    curves[m, k, c] = curve.lower, curve.upper
            if m:
                weights = self.weights(m)
                least[m] = least_mu(weights(omega)).lower
                bound, where = largest_least_mu(weights, omega)
                bounds[m] = bound, where / (2 * np.pi)
        one = {"units": "1"}
        names = ("model", "controller", "channel")
        return xr.Dataset(
            {
                "peak": (
                    (*names, "bound"),
                    peaks,
                    one | {"long_name": "certified bounds of the supremum of mu"},
                ),
                "mu": (
                    (*names, "bound", "frequency"),
                    curves,
                    one | {"long_name": "mu of robust performance"},
                ),
                "order": (names[:2], orders, {"long_name": "states of the controller"}),
                "least_mu": (
                    ("model", "frequency"),
                    least,
                    one | {"long_name": "mu that every controller leaves, both channels"},
                ),
                "least_peak": ("model", bounds[:, 0], one | {"long_name": "the largest of them"}),
                "least_peak_frequency": ("model", bounds[:, 1], {"units": "Hz"}),
            },
            coords={
                "model": list(MODELS),
                "controller": list(CONTROLLERS),
                "channel": list(CHANNELS),
                "bound": ["lower", "upper"],
                "frequency": ("frequency", FREQUENCIES, {"units": "Hz"}),
            },
        )

    def weights(self, model: int) -> Any:
        """Weights of the loop of a model over frequencies [rad/s]."""
        found = uncertainty(self.axis, self.covers[model - 1])
        assert isinstance(found, UncertaintyModel)
        return lambda omega: loop_weights(self.axis, found, 1.0, omega)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        upper, lower = (answer["peak"].sel(bound=bound) for bound in ("upper", "lower"))
        both = upper.sel(channel="both")
        statement = "largest lower over upper bound of a peak, less 1"
        checks = [Check("bounds", statement, float((lower / upper).max()) - 1, 0.0)]
        statement = "the least mu of any controller over a controller's peak, less 1"
        beaten = float((answer["least_peak"] / both).max()) - 1
        checks.append(Check("least mu", statement, beaten, TOLERANCE))
        statement = "peak of a single channel over that of both, less 1"
        single = float((upper / both).max()) - 1
        checks.append(Check("channels", statement, single, 2 * TOLERANCE))
        parametric = float(both.sel(model="parametric").min())
        statement = "least peak with parametric uncertainty, which the thesis has below 1"
        checks.append(Check("parametric", statement, parametric, 1.0))
        return checks

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for model in MODELS:
            at = answer.sel(model=model)
            for name in CONTROLLERS:
                bounds = at["peak"].sel(controller=name, channel="both")
                key = _key(model, name)
                numbers[f"peak_{key}"] = float(bounds.sel(bound="upper"))
                numbers[f"peak_lower_{key}"] = float(bounds.sel(bound="lower"))
            least = at["peak"].sel(channel="both", bound="upper").min()
            numbers[f"peak_{_key(model)}"] = float(least)
            if model != "parametric":
                numbers[f"least_possible_{_key(model)}"] = float(at["least_peak"])
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return {"peaks": peaks_table(answer)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {
            "disturbance": figure_6_4(self.axis, answer, "disturbance"),
            "both": figure_6_4(self.axis, answer, "both"),
        }


def _key(*names: str) -> str:
    """Of a metric."""
    kept = "".join(c if c.isalnum() else " " for c in " ".join(names))
    return "_".join(kept.split())
