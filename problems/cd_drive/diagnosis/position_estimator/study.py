"""Estimators of position and disturbance, tried on recorded runs whose truth is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import Check
from workbench.arrays import RealArray
from workbench.diagnosis import Estimator, KalmanEstimator, Rotation, estimate
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.study.declarations import identifier
from workbench.tables import markdown

from ...drive.disc import VELOCITY
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, Values, drives, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from ..defect_runs import ROTATION
from . import figures
from .exact_gain import exact_companion_gain
from .model import (
    FAST_BANDWIDTH,
    PRINTED_K_OBS,
    SLOW_BANDWIDTH,
    companion_gain,
    itae,
    kalman,
    thesis_estimator,
)
from .trials import SCRATCHED, Scratches, Trial

ADAPTATION_RATE = 10.0
"""Rate of the loop that follows the rotation frequency [1/s]: a sixth of the oscillators' (see
`Rotation`)."""
EFFORT_FLOOR = 0.1
"""Control effort [V] about which the adaptation fades."""
WINDOW = (-1.5e-3, 6.5e-3)
"""Time shown before and after the start of the last scratch but one [s]."""
STRIDE = 14
"""Whole runs are stored at every STRIDE-th sample."""
KEPT, EARLY = (
    slice(round(SCRATCHED * RATE), None, STRIDE),
    slice(None, round(SCRATCHED * RATE), STRIDE),
)
"""Samples kept of whole runs, from the first scratch on and before it."""
QUALITIES = np.linspace(0.0, 1.0, 41)
"""Constant qualities at which the stability of an estimator is judged."""
FIXED = ("thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman settled")
"""Estimators of constant gain, scaled by the quality; the last has the stationary Kalman gain."""
ESTIMATORS = (*FIXED, "Kalman")
"""All estimators."""
RIVALS = ("ITAE 300 Hz", "Kalman")
"""Estimators tried on all of the drives."""
CASES = ("known", "wrong", "adapted")
"""Rotation frequency in the estimator's model: the true one, a wrong one, or one that adapts."""
GAINS_AGREE = 0.15
"""Largest relative deviation from eq. 7.34, whose realisation is not stated."""
SPIKE = {"focus": 1e-6, "radial": 0.1e-6}
"""The spike of section 7.3.3 [m]; radially the same share of the error that can be read."""


@dataclass(frozen=True)
class PositionEstimator(Study):
    """Estimators over recorded runs whose truth is known."""

    axis: Axis
    scratches: Scratches
    wrong: float
    values: Values

    headline: ClassVar[str] = "spike_kalman_um"

    @property
    def quantifier(self) -> str:
        return "for these drives, in one simulated record of each"

    def designed(self, name: str, case: str = "known") -> Estimator | KalmanEstimator:
        """The estimator of this name, with one of CASES as its belief of the rotation."""
        frequency = ROTATION * (1.0 if case == "known" else 1.0 - self.wrong)
        rate = ADAPTATION_RATE * (case == "adapted")
        rotation = Rotation(frequency, adaptation=rate, floor=EFFORT_FLOOR)
        if name == "thesis":
            return thesis_estimator(self.axis, rotation)
        if name.startswith("Kalman"):
            found = kalman(self.axis, rotation)
            return found if name == "Kalman" else found.settled
        bandwidth = FAST_BANDWIDTH if name == "ITAE 5 kHz" else SLOW_BANDWIDTH
        return itae(self.axis, rotation, bandwidth)

    def estimated(self, trial: Trial, name: str, case: str = "known") -> Any:
        """Estimates of a trial by an estimator."""
        law = self.designed(name, case).controller
        return estimate(law, trial.record.f_en, trial.known, trial.quality)

    estimator, fixed, rival, case = dim(ESTIMATORS), dim(FIXED), dim(RIVALS), dim(CASES)
    phase, size = dim("during", "after", "quiet"), dim("rms", "largest")
    noise, quality_level = dim("present", "absent"), dim(QUALITIES)

    seed = part(lambda context: int(context.rng.integers(2**31)))
    trial = part(lambda self, seed: self.scratches.trial("nominal", seed))
    gain = part(lambda self: Laboratory(self.axis, "nominal").parameters.K_optn)

    @part
    def runs(self, trial: Trial) -> dict[tuple[str, str], Any]:
        """Estimates for the nominal drive by every estimator, by name and case."""
        return {(n, c): self.estimated(trial, n, c) for n in ESTIMATORS for c in CASES}

    known = part(lambda runs: [runs[name, "known"] for name in ESTIMATORS])

    @array((estimator, case, phase, size), "m")
    def error(self, trial: Trial, runs: Any) -> list[Any]:
        return [[trial.errors(runs[n, c].outputs[:, 1]) for c in CASES] for n in ESTIMATORS]

    measured = part(lambda trial, gain: trial.record.f_en / gain)
    error_measured = array((phase, size), "m", "", lambda trial, measured: trial.errors(measured))

    @arrays((), nominal_events="", false_alarms="", missed="", position_error="m")
    def scalars(self, trial: Trial, runs: Any) -> dict[str, float]:
        return {
            "nominal_events": len(trial.record.events),
            "false_alarms": int(((trial.quality < 1) & (trial.record.light == 1.0)).sum()),
            "missed": int(((trial.quality > 0) & self.scratches.covered(trial)).sum()),
            "position_error": abs(runs["Kalman", "known"].outputs[:, 2] - trial.record.x).max(),
        }

    @part
    def onset(self, trial: Trial) -> int:
        """The sample at which the last scratch but one begins."""
        return int(np.flatnonzero(np.diff((trial.record.light < 1.0).astype(int)) == 1)[-2])

    zoom = part(lambda onset: slice(*(onset + round(end * RATE) for end in WINDOW)))
    zoomed = dim(
        lambda trial, onset, zoom: 1e3 * (trial.record.time[zoom] - trial.record.time[onset]),
        unit="ms",
    )
    time = dim(lambda trial: trial.record.time[KEPT], unit="s")
    early = dim(lambda trial: trial.record.time[EARLY], unit="s")

    true_error = array(zoomed, "m", "", lambda trial, zoom: trial.error[zoom])
    measured_error = array(zoomed, "m", "", lambda measured, zoom: measured[zoom])
    quality = array(zoomed, "1", "", lambda trial, zoom: trial.quality[zoom])
    shown = (estimator, zoomed)
    estimated_error = array(shown, "m", "", lambda known, zoom: [r.outputs[zoom, 1] for r in known])
    effort_zoomed = array(shown, "V", "", lambda known, zoom: [r.disturbance[zoom] for r in known])
    courses = (estimator, time)
    effort = array(courses, "V", "u_p", lambda known: _kept([one.disturbance for one in known]))
    true_effort = array(time, "V", "", lambda self, time: self.true_u_p(time.values).astype("f4"))

    adapted = part(lambda runs: [runs[name, "adapted"].frequency for name in RIVALS])
    followed = array(
        (rival, time), "Hz", "rotation frequency followed", lambda adapted: _kept(adapted)
    )
    followed_start = array(
        (rival, early), "Hz", "", lambda adapted: [one[EARLY] for one in adapted]
    )

    def true_u_p(self, time: RealArray) -> RealArray:
        """u_p [V] of a disc that turns for ever: the control that makes the lens follow it."""
        bench = Laboratory(self.axis, "nominal")
        lens = bench.actuator.response([ROTATION])[0] * bench.coil_gain
        swing = red_book(self.axis).deviation / lens
        effort: RealArray = (swing * np.exp(2j * np.pi * ROTATION * time)).imag
        return effort

    K_obs = array("state", value=lambda self: companion_gain(self.axis))
    K_obs_printed = array(
        "state", value=lambda self: PRINTED_K_OBS if self.axis == "focus" else None
    )

    @array((fixed, quality_level), "1/s", "fastest growth at a quality that stays")
    def growth(self) -> list[RealArray]:
        return [growth_rates(self.designed(name)) for name in FIXED]

    @array((noise, phase, size), "m", "of the thesis' observer opened without delay")
    def prompt_error(self, seed: int) -> list[Any]:
        trials = [self.scratches.trial("nominal", seed, n, prompt=True) for n in (None, 0.0)]
        return [one.errors(self.estimated(one, "thesis").outputs[:, 1]) for one in trials]

    drive = dim(lambda self: [one.name for one in drives(self.axis, self.values)])

    @part
    def on_drives(self, seed: int, gain: float, context: Context) -> list[tuple[list[Any], int]]:
        """Errors of the rivals and, last, of the measurement; and events; drive by drive."""
        rivals = [self.designed(name, "adapted").controller for name in RIVALS]
        found = []
        for drive in context.track(list(drives(self.axis, self.values)), "drives"):
            one = self.scratches.trial(drive.name, seed)
            # The estimator works in units of f_en: the drive's own optical gain makes them metres.
            scale = gain / drive.K_optn
            runs = [estimate(each, one.record.f_en, one.known, one.quality) for each in rivals]
            errors = [one.errors(scale * run.outputs[:, 1]) for run in runs]
            errors.append(one.errors(one.record.f_en / drive.K_optn))
            found.append((errors, len(one.record.events)))
        return found

    drive_error = array(
        (drive, rival, phase, size), "m", "", lambda on_drives: [e[:-1] for e, _ in on_drives]
    )
    drive_measured = array(
        (drive, phase, size), "m", "", lambda on_drives: [e[-1] for e, _ in on_drives]
    )
    events = array(drive, value=lambda on_drives: [events for _, events in on_drives])

    @check()
    def of_runs(self, answer: Dataset) -> list[Check]:
        """The loop stays closed, the quality sees scratches alone, the lens is computed exactly."""
        lost = int(answer["nominal_events"]) + int(answer["events"].sum())
        x, off = "largest error of x, the nominal drive's answer to u [m]", answer["position_error"]
        return [
            Check("loop", "times that it was lost or regained, all drives", lost, 0.0),
            Check("quality, clean", "clean samples called bad", int(answer["false_alarms"]), 0.0),
            Check("quality, scratch", "covered samples trusted", int(answer["missed"]), 0.0),
            Check("lens", x, float(off), 1e-9),
        ]

    @check("K_obs", at_most=1e-3)
    def ackermann(self, K_obs: DataArray) -> DataArray:
        """distance from Ackermann's formula in exact arithmetic, relative"""
        return abs(K_obs / exact_companion_gain(self.axis) - 1).max()

    @check("equation 7.34", at_most=GAINS_AGREE)
    def printed(self, K_obs: DataArray, K_obs_printed: DataArray | None) -> Any:
        """largest deviation from a printed gain"""
        return None if K_obs_printed is None else abs(K_obs / K_obs_printed - 1).max()

    @check("spike", at_most=lambda self: SPIKE[self.axis])
    def spike(self, error: DataArray) -> DataArray:
        """largest error of the Kalman filter in 5 ms after a scratch [m]"""
        return _kalman(error, "known").sel(phase="after")

    @check("scratch", at_most=0.5)
    def scratch(self, error: DataArray, error_measured: DataArray) -> DataArray:
        """largest error of the Kalman filter in a scratch over that of the measurement"""
        return (_kalman(error, "known") / error_measured.sel(size="largest")).sel(phase="during")

    @check("adapted", at_most=0.5)
    def as_known(self, error: DataArray) -> DataArray:
        """largest error with the rotation followed over that with it known, less 1"""
        return (_kalman(error, "adapted") / _kalman(error, "known")).max() - 1.0

    @check("wrong rotation", at_most=0.5)
    def cured(self, error: DataArray) -> DataArray:
        """rms error with the rotation followed over that with it wrong, the slow observer"""
        quiet = error.sel(estimator="ITAE 300 Hz", phase="quiet", size="rms")
        return quiet.sel(case="adapted") / quiet.sel(case="wrong")

    @check("rotation", at_most=2e-3)
    def rotation_found(self, followed: DataArray) -> DataArray:
        """relative error of the frequency followed"""
        return abs(followed[:, -1] / ROTATION - 1).max()

    @check("drives, scratch", at_most=0.75, where="at {drive}")
    def improved(self, drive_error: DataArray, drive_measured: DataArray) -> DataArray:
        """largest error of the nominal drive's Kalman filter over that of the measurement"""
        return _in_scratch(drive_error.sel(rival="Kalman")) / _in_scratch(drive_measured)

    @check("drives, readable", at_most=lambda self: ACCEPTABLE_ERROR[self.axis], where="at {drive}")
    def readable(self, drive_error: DataArray) -> DataArray:
        """largest error of the nominal drive's Kalman filter in a scratch [m]"""
        return _in_scratch(drive_error.sel(rival="Kalman"))

    @metric
    def errors_um(self, error: DataArray) -> dict[str, DataArray]:
        sizes = {"spike": ("after", "largest"), "during": ("during", "largest")}
        return {
            f"{word}_{identifier(name)}{'' if case == 'known' else f'_{case}'}_um": 1e6
            * error.sel(estimator=name, case=case, phase=phase, size=size)
            for name in ESTIMATORS
            for case in CASES
            for word, (phase, size) in (sizes | {"rms_quiet": ("quiet", "rms")}).items()
        }

    @metric
    def rivals(self, drive_error: DataArray, followed: DataArray) -> dict[str, DataArray]:
        found, worst = {}, 1e6 * drive_error.sel(size="largest").max("drive")
        for name, word in ((one, identifier(one)) for one in RIVALS):
            found[f"drives_during_{word}_um"] = worst.sel(rival=name, phase="during")
            found[f"drives_spike_{word}_um"] = worst.sel(rival=name, phase="after")
            found[f"followed_{word}_hz"] = followed.sel(rival=name)[-1]
        return found

    @metric
    def deviations(self, K_obs: DataArray, K_obs_printed: DataArray | None) -> Any:
        off = [] if K_obs_printed is None else K_obs / K_obs_printed - 1
        return {f"K_obs_{k}_deviation": one for k, one in enumerate(off, start=1)}

    growths = metric("growth_{fixed}_per_s", lambda growth: growth.max("quality_level"))
    measured_um = metric("{phase}_measured_um", lambda error_measured: 1e6 * error_measured[:, 1])
    drives_during_measured_um = metric(lambda drive_measured: 1e6 * drive_measured[:, 0, 1].max())
    prompt_um = metric(
        "spike_thesis_prompt_noise_{noise}_um", lambda prompt_error: 1e6 * prompt_error[:, 1, 1]
    )
    K_p_settles_per_s = metric(
        lambda self: -np.log(abs(self.designed("thesis").poles()).max()) / PERIOD
    )
    scratch_ms = metric(lambda self: 1e3 * self.scratches.length / VELOCITY)

    @table
    def errors(self, error: DataArray, error_measured: DataArray) -> str:
        sizes = {("measured", ""): error_measured}
        sizes |= {(n, c): error.sel(estimator=n, case=c) for n in ESTIMATORS for c in CASES}
        rows = [
            [*words, *(f"{1e6 * float(one[k]):.3g}" for k in ((0, 1), (1, 1), (2, 0)))]
            for words, one in sizes.items()
        ]
        heads = ["estimator", "rotation", "in a scratch", "5 ms after", "otherwise, rms"]
        return "Largest errors of x_cd - x [um].\n\n" + markdown(heads, rows)

    @table
    def equation_7_34(self, K_obs: DataArray, K_obs_printed: DataArray | None) -> Any:
        if K_obs_printed is None:
            return None
        rows = [
            [k + 1, f"{one:.5g}", f"{own:.5g}", f"{own / one - 1:+.1%}"]
            for k, (one, own) in enumerate(zip(K_obs_printed.values, K_obs.values, strict=True))
        ]
        return ["K_obs", "printed", "computed", "deviation"], rows

    figure_7_14 = figure(figures.effort)
    figure_7_15 = figure(lambda self, answer: figures.error(answer, self.axis))
    rotation, drives = figure(figures.rotation), figure(figures.drives)
    graded_quality = figure(figures.growth)


def _kept(courses: list[RealArray]) -> Any:
    """The samples kept of whole runs, in single precision."""
    return np.array([one[KEPT] for one in courses], np.float32)


def _kalman(error: DataArray, case: str) -> DataArray:
    """Largest errors (phase,) of the Kalman filter."""
    return error.sel(estimator="Kalman", case=case, size="largest")


def _in_scratch(error: DataArray) -> DataArray:
    """Largest errors (drive,) in a scratch."""
    return error.sel(phase="during", size="largest")


def growth_rates(estimator: Estimator | KalmanEstimator) -> RealArray:
    """Growth rate [1/s] of the slowest mode at each of QUALITIES, which scales the gain.

    estimator: one of constant gain.
    """
    assert isinstance(estimator, Estimator)
    radii = [abs(estimator.poles(quality)).max() for quality in QUALITIES]
    return np.log(radii) / PERIOD
