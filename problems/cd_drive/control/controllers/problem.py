"""Every controller at 1X by the same certified analysis, and what none can beat (figure 6.4).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from workbench import Run, problem, ref
from workbench.arrays import RealArray, outward_single
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.mu import performance_peak, performance_sweep
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.synthesis import largest_least_mu, least_mu
from workbench.synthesis.mu.program import PEAK_TOLERANCE
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel

from ...drive.plants import Gain, controller
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ..control_problem import generalised
from ..design import cover_of, uncertainty
from ..five_x.study import CHANNELS
from ..loop_weights import loop_weights
from ..mu_pid import FREQUENCIES
from .report import figure_6_4, peaks_table

DESIGNS = {
    "third order": ("fixed", "reference"),
    "D-K": ("dk", ""),
    "(mu, D)-K": ("mu-dk", ""),
    "(D, G)-K": ("dgk", ""),
}
"""Synthesis method, and the controller that it starts from."""
MODELS = {
    "parametric": ("parametric", "steps", tuple(DESIGNS)),
    "circle": ("circle", "steps", ("third order", "D-K")),
    "circle, joint nominal": ("circle", "joint", ("D-K",)),
    "stadium": ("stadium", "steps", tuple(DESIGNS)),
}
"""Form of the uncertainty, method of its cover, and designs made for it.

Circles have no real scalar, so methods that use one are left out; the reference controller does not
stabilise the jointly chosen nominal, so no third-order design starts from it."""
CONTROLLERS = ("mu-PID", *DESIGNS)


class Judged(NamedTuple):
    """Peaks, curves and orders, with NaN where a design is not made for a model or is unstable."""

    peaks: RealArray
    curves: RealArray
    orders: RealArray


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

    @property
    def quantifier(self) -> str:
        return f"{EVERY_PERTURBATION}, for these controllers"

    def plant(self, model: int) -> GeneralisedPlant:
        """(w_p, w_u) to (z_p, z_u) without noise; the parametric model has no cover."""
        covered = self.covers[model - 1] if model else None
        return generalised(self.axis, uncertainty(self.axis, covered))

    def weights(self, model: int) -> Any:
        """Weights of the loop of a model, a function of frequencies [rad/s]."""
        found = uncertainty(self.axis, self.covers[model - 1])
        assert isinstance(found, UncertaintyModel)
        return lambda omega: loop_weights(self.axis, found, 1.0, omega)

    model, controller, channel = dim(MODELS), dim(CONTROLLERS), dim(CHANNELS)
    bound, frequency = dim("lower", "upper"), dim(FREQUENCIES, unit="Hz")
    over = (model, controller, channel)

    @part
    def judged(self, context: Context) -> Judged:
        import control

        omega = 2 * np.pi * FREQUENCIES
        shape = len(MODELS), len(CONTROLLERS), len(CHANNELS)
        peaks, curves = np.full((*shape, 2), np.nan), np.full((*shape, 2, len(omega)), np.nan)
        orders = np.full(shape[:2], np.nan)
        runs = iter(self.designed)
        for m, (_, _, designs) in enumerate(context.track(list(MODELS.values()), "models")):
            whole = self.plant(m)
            used = {"mu-PID": control.ss(controller(self.axis))}
            used |= {name: next(runs).answer.K for name in designs}
            for name, K in used.items():
                k = CONTROLLERS.index(name)
                orders[m, k] = K.nstates
                for c, (performance, exogenous) in enumerate(CHANNELS.values()):
                    plant = whole.channel(performance, exogenous)
                    found = performance_peak(plant, K, PEAK_TOLERANCE)
                    if found is not None:
                        peaks[m, k, c] = found.lower, found.upper
                        curve = performance_sweep(plant, K, omega)
                        curves[m, k, c] = curve.lower, curve.upper
        return Judged(peaks, curves, orders)

    @part
    def least(self) -> list[tuple[float, float]]:
        """Largest least mu of each model over frequency, and its frequency [Hz]."""
        omega = 2 * np.pi * FREQUENCIES
        found = (largest_least_mu(self.weights(m), omega) for m in range(1, len(MODELS)))
        return [(np.nan, np.nan), *((one.lower, one.omega / (2 * np.pi)) for one in found)]

    peak = array((*over, bound), "1", "certified bounds of the supremum of mu")(
        lambda judged: judged.peaks
    )
    mu = array((*over, bound, frequency), "1", "mu of robust performance")(
        lambda judged: outward_single(judged.curves)
    )
    order = array((model, controller), "", "states of the controller")(lambda judged: judged.orders)

    @array((model, frequency), "1", "mu that every controller leaves, both channels")
    def least_mu(self) -> list[RealArray]:
        omega = 2 * np.pi * FREQUENCIES
        found = (least_mu(self.weights(m)(omega)).lower for m in range(1, len(MODELS)))
        return [np.full(omega.shape, np.nan), *found]

    least_peak = array(model, "1", "the largest of them", lambda least: [mu for mu, _ in least])
    least_peak_frequency = array(model, "Hz", "", lambda least: [where for _, where in least])

    bounds = check(
        "bounds",
        "largest lower over upper bound of a peak, less 1",
        lambda peak: float((peak.sel(bound="lower") / peak.sel(bound="upper")).max()) - 1,
        at_most=0.0,
    )
    not_beaten = check(
        "least mu",
        "the least mu of any controller over a controller's peak, less 1",
        lambda peak, least_peak: float((least_peak / _both(peak)).max()) - 1,
        at_most=PEAK_TOLERANCE,
    )
    channels = check(
        "channels",
        "peak of a single channel over that of both, less 1",
        lambda peak: float((peak.sel(bound="upper") / _both(peak)).max()) - 1,
        at_most=2 * PEAK_TOLERANCE,
    )
    parametric = check(
        "parametric",
        "least peak with parametric uncertainty, which the thesis has below 1",
        lambda peak: float(_both(peak).sel(model="parametric").min()),
        at_most=1.0,
    )

    @metric
    def numbers(self, peak: DataArray, least_peak: DataArray) -> dict[str, float]:
        numbers = {}
        for model in MODELS:
            at, key = peak.sel(model=model, channel="both"), _key(model)
            for name in CONTROLLERS:
                bounds, design = at.sel(controller=name), _key(model, name)
                numbers[f"peak_{design}"] = float(bounds.sel(bound="upper"))
                numbers[f"peak_lower_{design}"] = float(bounds.sel(bound="lower"))
            numbers[f"peak_{key}"] = float(at.sel(bound="upper").min())
            if model != "parametric":
                numbers[f"least_possible_{key}"] = float(least_peak.sel(model=model))
        return numbers

    peaks = table(lambda answer: peaks_table(answer))

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {name: figure_6_4(self.axis, answer, name) for name in ("disturbance", "both")}


def _both(peak: DataArray) -> DataArray:
    """Upper bounds of the peaks of both channels together."""
    return peak.sel(bound="upper", channel="both")


def _key(*names: str) -> str:
    """A model, and a design, as they stand in the name of a metric."""
    kept = "".join(c if c.isalnum() else " " for c in " ".join(names))
    return "_".join(kept.split())
