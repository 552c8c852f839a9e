"""Robust performance at five times the disc's nominal speed (section 6.3.2, figure 6.5).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import chain
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run
from workbench.certify import stability_check
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.mu import Peak, PeakChecker, performance_peak, performance_sweep
from workbench.study import (
    Study,
    answers,
    array,
    arrays,
    check,
    dim,
    figure,
    metric,
    part,
    single_precision_bounds,
    system,
    table,
)
from workbench.synthesis import (
    PEAK_TOLERANCE,
    DualCertificate,
    HinfController,
    HinfSynthesis,
    LargestLeastMu,
    LargestLeastMuChecker,
    ReductionMethod,
    approximations,
    equalising_gain,
    hinf,
    largest_least_mu,
    least_mu,
)
from workbench.types import DataArray, Dataset, RealArray, StateSpace
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel, cover_sets

from ...drive.plants import controller
from ...drive.tables import Axis
from ..control_problem import generalised
from ..design import synthesis_plant, uncertainty
from ..loop_weights import BASIS
from ..mu_pid import FREQUENCIES
from .bounds import (
    BOUNDED,
    PROOFS,
    START_FACTOR,
    nominal_level,
    nominal_plant,
    proof_between,
)
from .checks import five_x_checks
from .report import conclusions_table, figure_6_5, peaks_table
from .uncertain_loop import SPEED, UncertainLoop

Plants = dict[str, GeneralisedPlant]
"""Generalised plants by channel."""
Case = tuple[str, str]
"""Controller and channel."""
Loops = dict[Case, tuple[GeneralisedPlant, StateSpace]]
"""Generalised plant and controller by case."""
AT_1X = "both at 1X"
"""Name of the pointwise bound at the disc's nominal speed."""
ORDER = 9
"""Order of the reduced controller that the thesis shows; its full one has 74."""
CHANNELS: dict[str, tuple[Any, Any]] = {
    "disturbance": ("z_p", "w_p"),
    "control": ("z_u", "w_u"),
    "both": (("z_p", "z_u"), "w_p"),
}
"""Performance outputs and exogenous inputs; w_p and w_u enter the loop at one place."""
REDUCTIONS: tuple[ReductionMethod, ...] = ("weighted", "balanced", "hankel")
"""Methods by which the designed controller is reduced."""
CONTROLLERS = {
    "mu-PID": "mu_pid",
    "adjusted mu-PID": "adjusted",
    "full order": "full",
    "ninth order": "ninth",
}
"""Controllers, with their names in metrics."""


@dataclass(frozen=True, eq=False)
class FiveX(Study):
    """Peaks and curves of four controllers, and lower bounds that hold for every controller."""

    axis: Axis
    covered: Run
    designed: Run

    headline: ClassVar[str] = "least_possible"

    @property
    def quantifier(self) -> str:
        return "for these controllers"

    @cached_property
    def loop(self) -> UncertainLoop:
        """The axis with the plants that the cover describes."""
        model = uncertainty(self.axis, self.covered)
        assert isinstance(model, UncertaintyModel)
        return UncertainLoop(self.axis, model)

    def controllers(self, answer: Dataset) -> dict[str, Any]:
        """The four controllers of an answer, by the names of CONTROLLERS."""
        return self._named(float(answer["adjusted_gain"]), self.ninth(answer))

    def _named(self, gain: float, ninth: StateSpace) -> dict[str, Any]:
        K = controller(self.axis)
        return dict(zip(CONTROLLERS, (K, gain * K, self.designed.answer.K, ninth), strict=True))

    # --- controllers --------------------------------------------------------------------------

    bound, bounded, proof = dim("lower", "upper"), dim(BOUNDED), dim(PROOFS)
    controller, channel = dim(CONTROLLERS), dim(CHANNELS)
    reduction = dim(REDUCTIONS)
    cover_frequency = dim(lambda self: self.covered.data["frequency"].values, unit="Hz")
    frequency = dim(
        lambda cover_frequency: np.unique(np.concatenate([cover_frequency.values, FREQUENCIES])),
        unit="Hz",
        meaning="frequency",
    )
    omega = part(lambda frequency: 2 * np.pi * frequency.values)

    @part
    def plants(self) -> dict[str, GeneralisedPlant]:
        whole = generalised(self.axis, self.loop.model, SPEED)
        return {
            name: whole.channel(performance=z, exogenous=w) for name, (z, w) in CHANNELS.items()
        }

    @array(dims=(), unit="1", meaning="gain of equal channels")
    def adjusted_gain(self, plants: Plants) -> float:
        gain = equalising_gain(plants["disturbance"], plants["control"], controller(self.axis))
        if np.isnan(gain):
            raise SolverError("no gain makes both channels equally bad")
        return gain

    @part
    def reductions(self, plants: Plants) -> dict[str, tuple[StateSpace, float]]:
        """The designed controller reduced by every method, and its peak, infinite if unstable."""
        plant = synthesis_plant(self.axis, self.loop.model, SPEED)
        found: dict[str, tuple[StateSpace, float]] = {}
        for method in REDUCTIONS:
            every = approximations(self.designed.answer.K, ORDER, method=method, plant=plant)
            direct = next(every)
            stabilises = partial(_stabilises, plants["both"])
            K = next(filter(stabilises, chain([direct], every)), direct)
            top = performance_peak(plants["both"], K, tolerance=PEAK_TOLERANCE)
            found[method] = K, top.upper if top else np.inf
        return found

    reduction_peak = array(
        dims=reduction, unit="1", meaning=f"peak of mu at order {ORDER}, infinite: unstable"
    )(lambda reductions: [upper for _, upper in reductions.values()])

    @system
    def ninth(self, reductions: dict[str, tuple[StateSpace, float]]) -> StateSpace:
        K, upper = min(reductions.values(), key=lambda each: each[1])
        if upper == np.inf:
            raise SolverError(f"no reduction to order {ORDER} stabilises the loop")
        return K

    # --- mu, and what none can beat -----------------------------------------------------------

    @part
    def loops(self, plants: Plants, adjusted_gain: DataArray, ninth: StateSpace) -> Loops:
        """Generalised plant and controller by names of controller and channel."""
        named = self._named(float(adjusted_gain), ninth)
        return {(name, c): (plants[c], K) for name, K in named.items() for c in CHANNELS}

    @answers
    def peaks(self, loops: Loops, context: Context) -> dict[Case, Peak | None]:
        """Peaks of robust performance; None if the nominal loop is unstable."""
        cases = context.track(list(loops), "peaks")
        return {case: performance_peak(*loops[case], tolerance=PEAK_TOLERANCE) for case in cases}

    @peaks.checkers
    def of_the_loops(self, loops: Loops) -> dict[Case, PeakChecker]:
        """Checker that certifies each peak."""
        return {
            case: PeakChecker(plant.close(K), plant.performance_structure)
            for case, (plant, K) in loops.items()
        }

    @part
    def curves(self, loops: Loops, peaks: Any, omega: RealArray, context: Context) -> list[Any]:
        """Bounds of mu over frequency (2, F) of each loop; NaN if the loop is unstable."""
        unstable = np.full((2, len(omega)), np.nan)
        cases = context.track(list(loops), "curves")
        return [_curve(*loops[case], omega) if peaks[case] else unstable for case in cases]

    over = (controller, channel)
    peak = array(dims=(*over, bound), unit="1", meaning="certified bounds")(
        lambda peaks: _gathered([_numbers(one)[:2] for one in peaks.values()])
    )
    peak_frequency = array(dims=over, unit="Hz", meaning="of the peak")(
        lambda peaks: _gathered([_numbers(one)[2] for one in peaks.values()])
    )
    mu = array(dims=(*over, bound, frequency), unit="1", meaning="mu of robust performance")(
        lambda curves: single_precision_bounds(_gathered(curves))
    )

    @array(
        dims=(bounded, bound, frequency), unit="1", meaning="least mu over all K at the frequency"
    )
    def least_mu(self, omega: RealArray) -> list[Any]:
        found = [least_mu(self.loop.weights(omega, channel)) for channel in BOUNDED]
        return [[each.lower, each.upper] for each in found]

    @array(
        dims=cover_frequency,
        unit="1",
        meaning="least mu over all K, stadiums without fitted weights",
    )
    def sets_least_mu(self, cover_frequency: DataArray) -> RealArray:
        narrow = cover_sets(self.covered.data, "second")
        alone = replace(
            self.loop.weights(2 * np.pi * cover_frequency.values),
            circular=narrow.radius,
            real=narrow.half_length * np.exp(1j * narrow.angle),
        )
        return least_mu(alone).lower

    @answers
    def pointwise(self, omega: RealArray) -> dict[str, LargestLeastMu]:
        """Bound for every controller at one frequency, for each of BOUNDED; the last is for both at
        1X.
        """
        return {
            name: largest_least_mu(weights, omega) for name, weights in self._pointwise().items()
        }

    @pointwise.checkers
    def of_the_weights(self) -> dict[str, LargestLeastMuChecker]:
        """Checker that certifies each bound."""
        return {name: LargestLeastMuChecker(each) for name, each in self._pointwise().items()}

    @answers
    def optimal(self) -> dict[str, HinfController]:
        """The H-infinity controller of the nominal plant."""
        return {"nominal": hinf(nominal_plant(self.loop))}

    @optimal.checkers
    def of_the_nominal_plant(self) -> dict[str, HinfSynthesis]:
        """Checker that certifies the norm."""
        return {"nominal": HinfSynthesis(nominal_plant(self.loop))}

    def _pointwise(self) -> dict[str, Any]:
        """Weights over frequency of each of BOUNDED at 5X, and of both at 1X."""
        found = {name: partial(self.loop.weights, channel=name) for name in BOUNDED}
        return found | {AT_1X: partial(self.loop.weights, speed=1.0)}

    @part
    def proofs(
        self, peaks: Any, pointwise: Any, optimal: Any, omega: RealArray, context: Context
    ) -> list[DualCertificate]:
        """Certificates over all frequencies, for each of PROOFS; NaN if none was found."""
        best = min(peaks[name, "both"].upper for name in CONTROLLERS if peaks[name, "both"])
        ends = {
            "nominal": (nominal_level(self.loop, omega), optimal["nominal"].norm),
            "dynamic": (START_FACTOR * pointwise["both"].lower, best),
        }
        return [proof_between(self.loop.loops[name], *ends[name], context) for name in PROOFS]

    pole = dim(-BASIS.corners, unit="rad/s", meaning="pole of h")
    pointwise_bound = array(
        dims=bounded, unit="1", meaning="mu that every controller has at one frequency"
    )(lambda pointwise: [pointwise[name].lower for name in BOUNDED])
    pointwise_frequency = array(
        dims=bounded, unit="Hz", meaning="frequency of the pointwise bound"
    )(lambda pointwise: [pointwise[name].omega / (2 * np.pi) for name in BOUNDED])
    pointwise_bound_1x = arrays(
        (),
        lambda pointwise: {"pointwise_bound_1X": pointwise[AT_1X].lower},
        pointwise_bound_1X=("1", "pointwise bound of both at 1X"),
    )
    nominal_norm = array(dims=(), unit="1", meaning="norm of the H-infinity loop")(
        lambda optimal: optimal["nominal"].norm
    )
    proven_level = array(dims=proof, unit="1", meaning="level that no controller reaches")(
        lambda proofs: [proof.level for proof in proofs]
    )
    proof_coefficients = array(dims=(proof, pole), unit="1", meaning="h of the proof")(
        lambda proofs: [proof.coefficients for proof in proofs]
    )

    # --- what is said of them -----------------------------------------------------------------

    @check()
    def closed_forms_and_proofs(self, answer: Dataset) -> list[Check]:
        return five_x_checks(self.loop, self.controllers(answer), answer)

    @metric
    def numbers(self, answer: Dataset) -> dict[str, float]:
        upper = answer["peak"].sel(bound="upper")
        peaks = {
            f"peak_{key}{'' if channel == 'both' else f'_{channel}'}": float(
                upper.sel(controller=name, channel=channel)
            )
            for name, key in CONTROLLERS.items()
            for channel in CHANNELS
        }
        nominal, dynamic = (float(answer["proven_level"].sel(proof=name)) for name in PROOFS)
        pointwise = answer[["pointwise_bound", "pointwise_frequency"]].sel(bounded="both")
        disturbance = answer["pointwise_bound"].sel(bounded="disturbance")
        found = {
            "adjusted_gain": answer["adjusted_gain"],
            "order_full": self.designed.answer.K.nstates,
            "nominal_bound": nominal,
            "nominal_norm": answer["nominal_norm"],
            "pointwise_bound": pointwise["pointwise_bound"],
            "pointwise_bound_disturbance": disturbance,
            "pointwise_frequency_hz": pointwise["pointwise_frequency"],
            "pointwise_bound_1X": answer["pointwise_bound_1X"],
            "pointwise_bound_sets": answer["sets_least_mu"].max(),
            "dynamic_bound": dynamic,
            "least_possible": np.nanmax([pointwise["pointwise_bound"], nominal, dynamic]),
            "least_reached": upper.sel(channel="both").min(),
        }
        return peaks | {name: float(value) for name, value in found.items()}

    @table
    def tables_of_thesis(self, answer: Dataset) -> dict[str, str]:
        conclusions = conclusions_table(self.axis, self.metrics(answer))
        return {"peaks": peaks_table(answer), "conclusions": conclusions}

    figure_6_5 = figure(lambda self, answer: figure_6_5(self.axis, answer))


def _numbers(peak: Peak | None) -> list[float]:
    """Bounds of a peak and its frequency [Hz]; NaN for an unstable loop."""
    return [np.nan] * 3 if peak is None else [peak.lower, peak.upper, peak.omega / (2 * np.pi)]


def _curve(plant: GeneralisedPlant, K: StateSpace, omega: RealArray) -> RealArray:
    """Bounds of mu of robust performance (2, F)."""
    found = performance_sweep(plant, K, omega)
    return np.array([found.lower, found.upper])


def _gathered(values: Sequence[Any]) -> RealArray:
    """Values of all controllers and channels, with an axis for each."""
    found = np.array(values)
    return found.reshape(len(CONTROLLERS), len(CHANNELS), *found.shape[1:])


def _stabilises(plant: GeneralisedPlant, K: StateSpace) -> bool:
    """Whether the loop of a plant and a controller is stable."""
    return stability_check(plant.close(K)).holds
