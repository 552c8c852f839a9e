"""All controllers at 1X by the same certified analysis, with bounds that none can beat (figure
6.4).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench import Run, problem, ref
from workbench.certificate import EVERY_PERTURBATION
from workbench.executor import Context
from workbench.mu import Peak, PeakChecker, Sweep, performance_peak, performance_sweep
from workbench.study import (
    Study,
    answers,
    array,
    check,
    dim,
    figure,
    metric,
    part,
    single_precision_bounds,
    table,
)
from workbench.synthesis import (
    PEAK_TOLERANCE,
    LargestLeastMu,
    LargestLeastMuChecker,
    largest_least_mu,
    least_mu,
)
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace
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

Circles have no real scalar, so methods that use one are left out. The reference controller does not
stabilise the jointly chosen nominal, so no third-order design starts from it there.
"""
CONTROLLERS = ("mu-PID", *DESIGNS)


Case = tuple[str, str, str]
"""Model, controller and channel."""
Loops = dict[Case, tuple[GeneralisedPlant, StateSpace]]
"""Generalised plant of a model and channel, and a controller."""


def needs(axis: str, frequencies: int = 400, gain: Gain = "own", **_: Any) -> dict[str, Any]:
    """References to the covers, and to the controller of every design for every model."""
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

    Peaks at 1X are certified for w_p -> z_p, for w_u -> z_u and for both, each with the uncertainty
    for which the controller was made. For circles and stadiums, the least mu that any controller
    can have at a frequency is given, and for circles the effect of a nominal that is chosen jointly
    with them.

    frequencies: number of frequencies of the covers, from 5 Hz to 5 kHz. gain: of the twelve
    drives.
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
        """Plant from (w_p, w_u) to (z_p, z_u) without noise; the parametric model needs no
        cover.
        """
        covered = self.covers[model - 1] if model else None
        return generalised(self.axis, uncertainty(self.axis, covered))

    def weights(self, model: int) -> Any:
        """Weights of the loop with a model, as a function of frequencies [rad/s]."""
        found = uncertainty(self.axis, self.covers[model - 1])
        assert isinstance(found, UncertaintyModel)
        return lambda omega: loop_weights(self.axis, found, 1.0, omega)

    model, controller, channel = dim(MODELS), dim(CONTROLLERS), dim(CHANNELS)
    bound, frequency = dim("lower", "upper"), dim(FREQUENCIES, unit="Hz")
    over = (model, controller, channel)

    @part
    def loops(self) -> Loops:
        """Generalised plant and controller for each model, design and channel."""
        import control

        runs, found = iter(self.designed), {}
        for m, (model, (_, _, designs)) in enumerate(MODELS.items()):
            whole = self.plant(m)
            used = {"mu-PID": control.ss(controller(self.axis))}
            used |= {name: next(runs).answer.K for name in designs}
            for (name, K), (channel, signals) in product(used.items(), CHANNELS.items()):
                performance, exogenous = signals
                found[model, name, channel] = (
                    whole.channel(performance=performance, exogenous=exogenous),
                    K,
                )
        return found

    @answers
    def loop_peaks(self, loops: Loops, context: Context) -> dict[Case, Peak | None]:
        """Peaks of robust performance; None if the nominal loop is unstable."""
        cases = context.track(list(loops), "peaks")
        return {case: performance_peak(*loops[case], tolerance=PEAK_TOLERANCE) for case in cases}

    @loop_peaks.checkers
    def of_the_loops(self, loops: Loops) -> dict[Case, PeakChecker]:
        """Checker that certifies each peak."""
        return {
            case: PeakChecker(plant.close(K), plant.performance_structure)
            for case, (plant, K) in loops.items()
        }

    @part
    def curves(self, loops: Loops, loop_peaks: Any, context: Context) -> dict[Case, Sweep]:
        """Mu over frequency of the stable loops."""
        cases = context.track([case for case, peak in loop_peaks.items() if peak], "curves")
        return {case: performance_sweep(*loops[case], 2 * np.pi * FREQUENCIES) for case in cases}

    @answers
    def least(self) -> dict[str, LargestLeastMu]:
        """Lower bound on the peak of every controller, for each model with fitted weights."""
        omega = 2 * np.pi * FREQUENCIES
        return {
            model: largest_least_mu(self.weights(m), omega) for m, model in enumerate(MODELS) if m
        }

    @least.checkers
    def of_the_models(self) -> dict[str, LargestLeastMuChecker]:
        """Checker that certifies each bound."""
        return {
            model: LargestLeastMuChecker(self.weights(m)) for m, model in enumerate(MODELS) if m
        }

    @array(dims=(*over, bound), unit="1", meaning="certified bounds of the supremum of mu")
    def peak(self, loop_peaks: dict[Case, Peak | None]) -> RealArray:
        """NaN if a design is not made for a model or is unstable."""
        found = np.full((len(MODELS), len(CONTROLLERS), len(CHANNELS), 2), np.nan)
        for case, one in loop_peaks.items():
            if one is not None:
                found[_place(case)] = one.lower, one.upper
        return found

    @array(dims=(*over, bound, frequency), unit="1", meaning="mu of robust performance")
    def mu(self, curves: dict[Case, Sweep]) -> NDArray[np.float32]:
        shape = len(MODELS), len(CONTROLLERS), len(CHANNELS), 2, len(FREQUENCIES)
        found = np.full(shape, np.nan)
        for case, curve in curves.items():
            found[_place(case)] = curve.lower, curve.upper
        return single_precision_bounds(found)

    @array(dims=(model, controller), unit="", meaning="states of the controller")
    def order(self, loops: Loops) -> RealArray:
        found = np.full((len(MODELS), len(CONTROLLERS)), np.nan)
        for case, (_, K) in loops.items():
            found[_place(case)[:2]] = K.nstates
        return found

    @array(
        dims=(model, frequency), unit="1", meaning="mu that every controller leaves, both channels"
    )
    def least_mu(self) -> list[RealArray]:
        omega = 2 * np.pi * FREQUENCIES
        found = (least_mu(self.weights(m)(omega)).lower for m in range(1, len(MODELS)))
        return [np.full(omega.shape, np.nan), *found]

    least_peak = array(
        dims=model,
        unit="1",
        meaning="the largest of them",
        value=lambda least: [np.nan, *(one.lower for one in least.values())],
    )
    least_peak_frequency = array(
        dims=model,
        unit="Hz",
        meaning="",
        value=lambda least: [np.nan, *(one.omega / (2 * np.pi) for one in least.values())],
    )

    bounds = check(
        title="bounds",
        statement="largest lower over upper bound of a peak, less 1",
        value=lambda peak: float((peak.sel(bound="lower") / peak.sel(bound="upper")).max()) - 1,
        at_most=0.0,
    )
    not_beaten = check(
        title="least mu",
        statement="the least mu of any controller over a controller's peak, less 1",
        value=lambda peak, least_peak: float((least_peak / _both(peak)).max()) - 1,
        at_most=PEAK_TOLERANCE,
    )
    channels = check(
        title="channels",
        statement="peak of a single channel over that of both, less 1",
        value=lambda peak: float((peak.sel(bound="upper") / _both(peak)).max()) - 1,
        at_most=2 * PEAK_TOLERANCE,
    )
    parametric = check(
        title="parametric",
        statement="least peak with parametric uncertainty, which the thesis has below 1",
        value=lambda peak: float(_both(peak).sel(model="parametric").min()),
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
    """Names of models and designs in the names of metrics."""
    kept = "".join(c if c.isalnum() else " " for c in " ".join(names))
    return "_".join(kept.split())


def _place(case: Case) -> tuple[int, int, int]:
    """Indices of a model, a controller and a channel in arrays."""
    model, name, channel = case
    return list(MODELS).index(model), CONTROLLERS.index(name), list(CHANNELS).index(channel)
