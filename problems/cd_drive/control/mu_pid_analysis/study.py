"""Robust performance of the reference controller under three uncertainty models (section 6.3).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from workbench import Check, Run
from workbench.executor import Context
from workbench.geometry import smallest_area_stadium
from workbench.mu import Peak, PeakChecker, condition_systems, conditions, performance_sweep
from workbench.structure import Structure
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
from workbench.synthesis import equalising_gain
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace
from workbench.uncertainty import (
    GeneralisedPlant,
    ParametricModel,
    UncertaintyModel,
    cover_function,
    cover_sets,
)

from ...drive.plants import GAIN_VARIANTS, controller
from ...drive.tables import Axis
from ...uncertainty.covered import covered_responses
from ..control_problem import generalised
from ..design import uncertainty
from ..loop_weights import CHANNELS, channel_of
from .checks import mu_pid_checks
from .report import claims_table, conditions_table, mu_figures, sets_table

LoopCase = tuple[Any, ...]
"""Gain variant, speed, channel and form of uncertainty of a loop; a condition may follow."""
Loops = dict[LoopCase, GeneralisedPlant]
"""Generalised plants by case."""
FORMS = ("parametric", "circle", "stadium")
COVERS = FORMS[1:]
SETS = (
    "circle",
    "stadium narrowest",
    "stadium third set",
    "stadium for mu",
    "stadium of smallest area",
)
SPEEDS = (1.0, 5.0)
CONDITIONS = {
    "nominal_performance": "nominal performance",
    "robust_stability": "robust stability",
    "robust_performance": "robust performance",
}
ANALYSIS_PEAK_TOLERANCE = 1e-4
"""Relative width of the interval that certifies a peak."""


@dataclass(frozen=True, eq=False)
class MuPidAnalysis(Study):
    """Peaks, curves over frequency, and the gain adjusted to 5X."""

    axis: Axis
    runs: dict[tuple[str, str], Run]

    headline: ClassVar[str] = "peak_stadium"

    @property
    def quantifier(self) -> str:
        return "at the frequencies of the covers"

    def model(self, form: str, gain: str) -> UncertaintyModel | ParametricModel:
        """Uncertain plant u [V] -> f_en [units]; the parametric one has no gain variants."""
        return uncertainty(self.axis, self.runs.get((form, gain)))

    def plant(self, gain: str, speed: float, channel: str, form: str) -> GeneralisedPlant:
        """The generalised plant with the signals of one channel, or of both."""
        exogenous, performance = CHANNELS.get(channel, (None, None))
        whole = generalised(self.axis, self.model(form, gain), speed)
        return whole.channel(performance=performance, exogenous=exogenous)

    gain, speed, form, bound = dim(GAIN_VARIANTS), dim(SPEEDS), dim(FORMS), dim("lower", "upper")
    channel, single = dim(*CHANNELS, "both"), dim(CHANNELS)
    condition, set = dim(*CONDITIONS.values()), dim(SETS)
    frequency = dim(
        lambda self: self.runs["circle", "own"].data["frequency"].values,
        unit="Hz",
        meaning="frequency",
    )
    omega = part(lambda frequency: 2 * np.pi * frequency.values)
    cases = (gain, speed, channel, form)

    @part
    def loops(self) -> Loops:
        """Plants of all cases; there is one parametric model for all gain variants."""
        cases = product(GAIN_VARIANTS, SPEEDS, (*CHANNELS, "both"), FORMS)
        return {case: self.plant(*case) for case in cases if case == _modelled(case)}

    @part
    def questions(self, loops: Loops) -> dict[LoopCase, tuple[StateSpace, Structure]]:
        """System that a perturbation closes, and the perturbation's structure, by case and
        condition.
        """
        K = controller(self.axis)
        return {
            (*case, condition): question
            for case, plant in loops.items()
            for condition, question in condition_systems(plant, K).items()
        }

    @answers
    def peaks(self, loops: Loops, context: Context) -> dict[LoopCase, Peak | None]:
        """Peaks of each case and condition; None for an unstable loop."""
        K = controller(self.axis)
        found: dict[LoopCase, Peak | None] = {}
        for case in context.track(list(loops), "peaks"):
            judged = conditions(loops[case], K, tolerance=ANALYSIS_PEAK_TOLERANCE)
            found |= {(*case, name): getattr(judged, name) for name in CONDITIONS}
        return found

    @peaks.checkers
    def of_the_questions(self, questions: Any) -> dict[LoopCase, PeakChecker]:
        """Checker that certifies each peak."""
        return {case: PeakChecker(*question) for case, question in questions.items()}

    @part
    def curves(self, loops: Loops, omega: RealArray, context: Context) -> dict[LoopCase, RealArray]:
        """Lower and upper bound of robust performance (2, F) of each case."""
        K, cases = controller(self.axis), context.track(list(loops), "curves")
        return {case: _curve(loops[case], K, omega) for case in cases}

    peak = array(
        dims=(*cases, condition, bound), unit="1", meaning="certified bounds of the supremum of mu"
    )(lambda peaks: _gathered(lambda case: _over_conditions(peaks, case)[:, :2]))
    peak_frequency = array(
        dims=(*cases, condition), unit="Hz", meaning="frequency of the largest mu"
    )(lambda peaks: _gathered(lambda case: _over_conditions(peaks, case)[:, 2]))
    mu = array(dims=(*cases, bound, frequency), unit="1", meaning="mu of robust performance")(
        lambda curves: single_precision_bounds(_gathered(curves.__getitem__))
    )

    @array(
        dims=(gain, speed, single, set, frequency),
        unit="1",
        meaning="mu of robust performance, no weights fitted",
    )
    def set_mu(self, omega: RealArray, context: Context) -> NDArray[np.float32]:
        """Mu of the covers' sets, each about its own nominal."""
        every = list(product(GAIN_VARIANTS, SPEEDS, CHANNELS))
        found = np.array([self._sets(*case, omega) for case in context.track(every, "sets")])
        sizes = (len(GAIN_VARIANTS), len(SPEEDS), len(CHANNELS), *found.shape[1:])
        return found.reshape(sizes).astype(np.float32)

    def _sets(self, gain: str, speed: float, single: str, omega: RealArray) -> list[RealArray]:
        found = []
        for form in COVERS:
            run = self.runs[form, gain]
            drives, data = covered_responses(run), run.data
            nominal = cover_function(data, "nominal")
            assert nominal is not None
            loop = channel_of(self.axis, nominal, controller(self.axis), single, speed, omega)
            away = drives.values / nominal.response(omega)[:, None] - 1
            sets = [cover_sets(data, "second")]
            if form == "stadium":
                sets += [
                    cover_sets(data, "third"),
                    loop.stadiums_of_least_mu(omega, away),
                    smallest_area_stadium(away, center=0.0),
                ]
            found += [loop.mu(each) for each in sets]
        return found

    @part
    def at_5x(self) -> list[GeneralisedPlant]:
        """Plants of the single channels at 5X, with stadiums."""
        return [self.plant(GAIN_VARIANTS[0], SPEEDS[-1], single, "stadium") for single in CHANNELS]

    adjusted_gain = array(
        dims=(), unit="1", meaning="gain at which both channels are equally bad"
    )(  # or NaN without a solution
        lambda self, at_5x: equalising_gain(at_5x[0], at_5x[1], controller(self.axis))
    )

    @array(
        dims=(single, bound, frequency),
        unit="1",
        meaning="mu of robust performance at the adjusted gain",
    )
    def adjusted_mu(self, at_5x: Any, adjusted_gain: DataArray, omega: RealArray) -> RealArray:
        gain = float(adjusted_gain)
        if np.isnan(gain):
            return np.full((len(CHANNELS), 2, omega.size), np.nan)
        return np.array([_curve(plant, gain * controller(self.axis), omega) for plant in at_5x])

    @check()
    def closed_forms_and_samples(self, answer: Dataset) -> list[Check]:
        covers = {case: run.data for case, run in self.runs.items()}
        return mu_pid_checks(self.axis, covers, answer)

    @metric
    def peaks_of_channels(self, peak: DataArray, peak_frequency: DataArray) -> dict[str, float]:
        """Peaks of robust performance of the single channels, and their frequencies [Hz]."""
        numbers = {}
        for gain, speed, form, channel in product(GAIN_VARIANTS, SPEEDS, FORMS, CHANNELS):
            if form == "parametric" and gain != "own":
                continue
            case = {"gain": gain, "speed": speed, "channel": channel, "form": form}
            at = case | {"condition": "robust performance"}
            parts = [
                form,
                *(() if channel == "disturbance" else (channel,)),
                *(() if speed == 1 else ("5X",)),
                *(() if gain == "own" else (gain,)),
            ]
            name = "_".join(parts)
            numbers[f"peak_{name}"] = float(peak.sel(at).sel(bound="upper"))
            numbers[f"peak_lower_{name}"] = float(peak.sel(at).sel(bound="lower"))
            numbers[f"frequency_{name}_hz"] = float(peak_frequency.sel(at))
        return numbers

    adjusted_gain_5x = metric(
        template="adjusted_gain_5X", value=lambda adjusted_gain: adjusted_gain
    )
    set_peak = metric(
        template="set_peak_{set}",
        value=lambda set_mu: set_mu.sel(gain="own", speed=1.0, single="disturbance").max(
            "frequency"
        ),
    )

    @metric
    def conservative(self, mu: DataArray) -> dict[str, float]:
        """Share of frequencies at which mu is larger with stadiums than with circles at 1X, and the
        excess.
        """
        curve = mu.sel(gain="own", speed=1.0, channel="disturbance", bound="upper")
        ratio = curve.sel(form="stadium") / curve.sel(form="circle")
        return {
            "stadium_above_circle_share": float((ratio > 1.0).mean()),
            "stadium_over_circle_most": float(ratio.max()),
            "stadium_over_circle_least": float(ratio.min()),
        }

    @metric
    def above_one(self, set_mu: DataArray) -> dict[str, float]:
        """Share of the frequencies at which mu of the sets themselves exceeds 1 at 1X."""
        curve = set_mu.sel(gain="own", speed=1.0, single="disturbance")
        share = (curve > 1.0).mean("frequency")
        return {
            f"set_above_1_{name.replace(' ', '_')}": float(share.sel(set=name)) for name in SETS
        }

    claims = table(lambda answer: claims_table(answer))
    conditions = table(lambda answer: conditions_table(answer))
    sets = table(lambda set_mu: sets_table(set_mu))

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return mu_figures(self.axis, answer)


def _curve(plant: GeneralisedPlant, K: Any, omega: RealArray) -> RealArray:
    """Lower and upper bound of robust performance (2, F)."""
    found = performance_sweep(plant, K, omega)
    return np.array([found.lower, found.upper])


def _numbers(peak: Peak | None) -> list[float]:
    """Lower and upper bound, and the frequency [Hz]; bounds are missing for an unstable loop."""
    if peak is None:
        return [np.nan] * 3
    return [peak.lower, peak.upper, peak.omega / (2 * np.pi)]


def _over_conditions(peaks: dict[LoopCase, Peak | None], case: LoopCase) -> RealArray:
    """Lower and upper bound and frequency [Hz] of each condition of a case (condition, 3)."""
    return np.array([_numbers(peaks[*case, name]) for name in CONDITIONS])


def _modelled(case: LoopCase) -> LoopCase:
    """The case with the same loop that is actually computed."""
    gain, *rest = case
    return (GAIN_VARIANTS[0] if rest[-1] == "parametric" else gain, *rest)


def _gathered(of: Callable[[LoopCase], RealArray]) -> RealArray:
    """Values of a function for all loops, as one array with an axis for each choice."""
    cases = product(GAIN_VARIANTS, SPEEDS, (*CHANNELS, "both"), FORMS)
    rows = [of(_modelled(case)) for case in cases]
    sizes = (len(GAIN_VARIANTS), len(SPEEDS), len(CHANNELS) + 1, len(FORMS))
    return np.reshape(rows, (*sizes, *rows[0].shape))
