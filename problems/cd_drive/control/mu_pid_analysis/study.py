"""Robust performance of the reference controller under three uncertainty models (section 6.3).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, ClassVar, get_args

import numpy as np

from workbench import Check, Run, Study
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.mu import Peak, conditions, performance_sweep
from workbench.synthesis import equalising_gain
from workbench.uncertainty import GeneralisedPlant, ParametricModel, UncertaintyModel
from workbench.uncertainty.covers.storage import rational, shape

from ...drive.plants import Gain, controller
from ...drive.tables import Axis
from ..control_problem import generalised
from ..design import uncertainty
from ..loop_weights import CHANNELS, channel_of
from .checks import mu_pid_checks
from .report import claims_table, conditions_table, mu_figures, sets_table

FORMS = ("parametric", "circle", "stadium")
COVERS = FORMS[1:]
SETS = ("circle", "stadium narrowest", "stadium third set", "stadium for mu")
GAINS: tuple[Gain, ...] = get_args(Gain)
SPEEDS = (1.0, 5.0)
CONDITIONS = {
    "nominal_performance": "nominal performance",
    "robust_stability": "robust stability",
    "robust_performance": "robust performance",
}
TOLERANCE = 1e-4
"""Of the certified peaks, relative."""


@dataclass(frozen=True, eq=False)
class MuPidAnalysis(Study):
    """Peaks, curves over frequency, and the gain adjusted to 5X."""

    axis: Axis
    runs: dict[tuple[str, str], Run]

    headline: ClassVar[str] = "peak_stadium"

    @cached_property
    def frequency(self) -> RealArray:
        """Where the drives were measured [Hz] (F,)."""
        values: RealArray = self.runs["circle", "own"].data["frequency"].values
        return values

    def model(self, form: str, gain: str) -> UncertaintyModel | ParametricModel:
        """The uncertainty of u [V] -> f_en [units]; the parametric one has no gain variants."""
        return uncertainty(self.axis, self.runs.get((form, gain)))

    def plant(self, gain: str, speed: float, channel: str, form: str) -> GeneralisedPlant:
        """The generalised plant with the signals of one channel, or of both."""
        exogenous, performance = CHANNELS.get(channel, (None, None))
        whole = generalised(self.axis, self.model(form, gain), speed)
        return whole.channel(performance, exogenous)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        K = controller(self.axis)
        axes = (GAINS, SPEEDS, (*CHANNELS, "both"), FORMS)
        peaks: dict[Any, Any] = {}
        curves: dict[Any, Any] = {}
        for case in context.track(list(product(*axes)), "loops"):
            gain, *rest = case
            if rest[-1] == "parametric" and gain != GAINS[0]:  # one model for all variants
                peaks[case], curves[case] = peaks[GAINS[0], *rest], curves[GAINS[0], *rest]
                continue
            plant = self.plant(*case)
            found = conditions(plant, K, tolerance=TOLERANCE)
            peaks[case] = [_numbers(getattr(found, name)) for name in CONDITIONS]
            curves[case] = self._curve(plant, K)
        single = (GAINS, SPEEDS, tuple(CHANNELS))
        sets = {
            case: self._sets(*case, K) for case in context.track(list(product(*single)), "sets")
        }
        adjusted, at_adjusted = self._adjusted(K)
        numbers = _gathered(peaks, axes)
        names = ("gain", "speed", "channel", "form")
        return xr.Dataset(
            {
                "peak": (
                    (*names, "condition", "bound"),
                    numbers[..., :2],
                    {"units": "1", "long_name": "certified bounds of the supremum of mu"},
                ),
                "peak_frequency": (
                    (*names, "condition"),
                    numbers[..., 2],
                    {"units": "Hz", "long_name": "frequency of the largest mu"},
                ),
                "mu": (
                    (*names, "bound", "frequency"),
                    _gathered(curves, axes),
                    {"units": "1", "long_name": "mu of robust performance"},
                ),
                "set_mu": (
                    ("gain", "speed", "single", "set", "frequency"),
                    _gathered(sets, single),
                    {"units": "1", "long_name": "mu of robust performance, no weights fitted"},
                ),
                "adjusted_gain": (
                    (),
                    adjusted,
                    {"units": "1", "long_name": "gain at which both channels are equally bad"},
                ),
                "adjusted_mu": (
                    ("single", "bound", "frequency"),
                    at_adjusted,
                    {"units": "1", "long_name": "mu of robust performance at the adjusted gain"},
                ),
            },
            coords={
                "gain": list(GAINS),
                "speed": list(SPEEDS),
                "channel": list(axes[2]),
                "single": list(CHANNELS),
                "form": list(FORMS),
                "condition": list(CONDITIONS.values()),
                "bound": ["lower", "upper"],
                "set": list(SETS),
                "frequency": (
                    "frequency",
                    self.frequency,
                    {"units": "Hz", "long_name": "frequency"},
                ),
            },
        )

    def _curve(self, plant: GeneralisedPlant, K: Any) -> RealArray:
        """Lower and upper bound of robust performance (2, F)."""
        found = performance_sweep(plant, K, 2 * np.pi * self.frequency)
        return np.array([found.lower, found.upper])

    def _sets(self, gain: str, speed: float, single: str, K: Any) -> RealArray:
        """Mu of the covers' sets, each about its own nominal, (set, F)."""
        omega = 2 * np.pi * self.frequency
        found = []
        for form in COVERS:
            data = self.runs[form, gain].data
            nominal = rational(data, "nominal")
            assert nominal is not None
            loop = channel_of(self.axis, nominal, K, single, speed, omega)
            away = data["response"].values / nominal.response(omega)[:, None] - 1
            sets = [shape(data, "second")]
            if form == "stadium":
                sets += [shape(data, "third"), loop.stadiums_of_least_mu(omega, away)]
            found += [loop.mu(each) for each in sets]
        return np.array(found)

    def _adjusted(self, K: Any) -> tuple[float, RealArray]:
        """At 5X with stadiums: the factor on K that makes both channels' peaks equal, and mu.

        NaN where no factor up to that of instability does.
        """
        disturbance, control = (
            self.plant(GAINS[0], SPEEDS[-1], single, "stadium") for single in CHANNELS
        )
        gain = equalising_gain(disturbance, control, K)
        if np.isnan(gain):
            return gain, np.full((len(CHANNELS), 2, self.frequency.size), np.nan)
        return gain, np.array([self._curve(plant, gain * K) for plant in (disturbance, control)])

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        covers = {case: run.data for case, run in self.runs.items()}
        return mu_pid_checks(self.axis, covers, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {"adjusted_gain_5X": float(answer["adjusted_gain"])}
        for gain, speed, form in product(GAINS, SPEEDS, FORMS):
            for channel in ("disturbance", "control"):
                case = {"gain": gain, "speed": speed, "channel": channel, "form": form}
                at = {"condition": "robust performance"}
                parts = [
                    form,
                    *(() if channel == "disturbance" else (channel,)),
                    *(() if speed == 1 else ("5X",)),
                    *(() if gain == "own" else (gain,)),
                ]
                if form == "parametric" and gain != "own":
                    continue
                name = "_".join(parts)
                bounds = answer["peak"].sel(case).sel(at)
                numbers[f"peak_{name}"] = float(bounds.sel(bound="upper"))
                numbers[f"peak_lower_{name}"] = float(bounds.sel(bound="lower"))
                numbers[f"frequency_{name}"] = float(answer["peak_frequency"].sel(case).sel(at))
        sets = answer["set_mu"].sel(gain="own", speed=1.0, single="disturbance").max("frequency")
        for each in SETS:
            numbers[f"set_peak_{each.replace(' ', '_')}"] = float(sets.sel(set=each))
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return {
            "claims": claims_table(answer),
            "conditions": conditions_table(answer),
            "sets": sets_table(answer),
        }

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return mu_figures(self.axis, answer)


def _numbers(peak: Peak | None) -> list[float]:
    """Lower and upper bound, and the frequency [Hz]; no bound of an unstable loop."""
    if peak is None:
        return [np.nan] * 3
    return [peak.lower, peak.upper, peak.omega / (2 * np.pi)]


def _gathered(found: dict[Any, Any], axes: Sequence[Sequence[Any]]) -> RealArray:
    """What was found for every combination, as one array with an axis for each choice."""
    rows = np.array([found[case] for case in product(*axes)])
    return rows.reshape(*(len(axis) for axis in axes), *rows.shape[1:])
