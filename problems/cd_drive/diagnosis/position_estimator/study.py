"""Estimators of position and disturbance, tried on recorded runs with known truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.diagnosis import Estimator, KalmanEstimator, Rotation, estimate
from workbench.executor import Context
from workbench.study import Study, array, arrays, dim, independent_seeds, part
from workbench.types import DataArray, RealArray

from ...drive.tables import Axis, Values, drives, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from ..defect_runs import ROTATION
from ..scratch_draws import ScratchDraw
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
"""Rate of the loop that tracks the rotation frequency [1/s]: a sixth of the oscillators' rate (see
`Rotation`).
"""
EFFORT_FLOOR = 0.1
"""Control effort [V] around which the adaptation fades out."""
WINDOW = (-1.5e-3, 6.5e-3)
"""Time shown before and after the start of the last scratch but one [s]."""
STRIDE = 14
"""Distance [samples] between stored samples of whole runs."""
KEPT, EARLY = (
    slice(round(SCRATCHED * RATE), None, STRIDE),
    slice(None, round(SCRATCHED * RATE), STRIDE),
)
"""Stored samples of whole runs: from the first scratch on, and before it."""
QUALITIES = np.linspace(0.0, 1.0, 41)
"""Constant qualities at which the stability of an estimator is analysed."""
FIXED = ("thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman settled")
"""Estimators of constant gain, which the quality scales; the last has the stationary Kalman gain.
"""
ESTIMATORS = (*FIXED, "Kalman")
"""All estimators."""
RIVALS = ("ITAE 300 Hz", "Kalman")
"""Estimators tried on all of the drives."""
CASES = ("known", "wrong", "adapted")
"""Rotation frequency in the estimator's model: the true one, a wrong one, or an adapted one."""


COUNTED = {
    "nominal_events": "",
    "clean": "",
    "false_alarms": "",
    "covered": "",
    "missed": "",
    "position_error": "m",
}
"""Numbers counted or measured in each draw on the nominal drive, with their units."""
PRINTED_ANGLE = 0.25
"""Angle of the scratch of the figures [revolutions]."""


def estimated(trial: Trial, law: Any) -> Any:
    """Estimates for a trial by the law of an estimator."""
    return estimate(law, trial.record.f_en, trial.known, trial.quality)


def _each(name: str) -> Any:
    """A function that collects one result of the draws on the nominal drive."""
    return lambda on_nominal: np.array([one[name] for one in on_nominal], np.float32)


@dataclass(frozen=True)
class EstimatorTrials(Study):
    """Estimators on recorded runs with known truth: the stored results."""

    axis: Axis
    scratches: Scratches
    wrong: float
    values: Values
    draws: int

    @property
    def quantifier(self) -> str:
        return f"for these drives, in {self.draws} simulated draws of each"

    def designed(self, name: str, case: str = "known") -> Estimator | KalmanEstimator:
        """The estimator with this name, whose rotation is one of CASES."""
        frequency = ROTATION * (1.0 if case == "known" else 1.0 - self.wrong)
        rate = ADAPTATION_RATE * (case == "adapted")
        rotation = Rotation(frequency, adaptation=rate, floor=EFFORT_FLOOR)
        if name == "thesis":
            return thesis_estimator(self.axis, rotation)
        if name.startswith("Kalman"):
            found = kalman(self.axis, rotation)
            return found if name == "Kalman" else found.steady_state
        bandwidth = FAST_BANDWIDTH if name == "ITAE 5 kHz" else SLOW_BANDWIDTH
        return itae(self.axis, rotation, bandwidth)

    estimator, fixed, rival, case = dim(ESTIMATORS), dim(FIXED), dim(RIVALS), dim(CASES)
    phase, size = dim("during", "after", "quiet"), dim("rms", "largest")
    quality_level = dim(QUALITIES)

    draw = dim(lambda self: range(self.draws))
    gain = part(lambda self: Laboratory(self.axis, "nominal").parameters.K_optn)

    # --- the nominal drive, draw by draw ------------------------------------------------------

    nominal_seed = array(
        dims=draw, value=lambda self, context: independent_seeds(context.rng, self.draws)
    )

    laws = part(
        lambda self: {(n, c): self.designed(n, c).controller for n in ESTIMATORS for c in CASES}
    )

    @part
    def on_nominal(
        self,
        nominal_seed: DataArray,
        gain: float,
        laws: dict[tuple[str, str], Any],
        context: Context,
    ) -> list[Any]:
        """Results of each draw on the nominal drive, by the names of the arrays."""

        def met(seed: int) -> dict[str, Any]:
            scratch = ScratchDraw.drawn(self.axis, seed)
            trial = self.scratches.trial("nominal", scratch)
            runs = {case: estimated(trial, law) for case, law in laws.items()}
            clean, covered = trial.record.light == 1.0, self.scratches.covered(trial)
            prompt = self.scratches.trial("nominal", scratch, prompt=True)
            return {
                "error": [
                    [trial.errors(runs[n, c].outputs[:, 1]) for c in CASES] for n in ESTIMATORS
                ],
                "error_measured": trial.errors(trial.record.f_en / gain),
                "prompt_error": prompt.errors(
                    estimated(prompt, laws["thesis", "known"]).outputs[:, 1]
                ),
                "followed_last": [runs[n, "adapted"].frequency_hz[-1] for n in RIVALS],
                "nominal_events": len(trial.record.events),
                "clean": int(clean.sum()),
                "false_alarms": int((clean & (trial.quality < 1)).sum()),
                "covered": int(covered.sum()),
                "missed": int((covered & (trial.quality > 0)).sum()),
                "position_error": abs(runs["Kalman", "known"].outputs[:, 2] - trial.record.x).max(),
            }

        return context.spread(met, nominal_seed.values.tolist(), "draws, nominal drive")

    error = array(
        dims=(draw, estimator, case, phase, size), unit="m", meaning="", value=_each("error")
    )
    error_measured = array(
        dims=(draw, phase, size), unit="m", meaning="", value=_each("error_measured")
    )
    prompt_error = array(
        dims=(draw, phase, size),
        unit="m",
        meaning="of the thesis' observer opened without delay",
        value=_each("prompt_error"),
    )
    followed_last = array(
        dims=(draw, rival), unit="Hz", meaning="at the end of the run", value=_each("followed_last")
    )
    scalars = arrays(
        draw,
        lambda on_nominal: {name: [one[name] for one in on_nominal] for name in COUNTED},
        **COUNTED,
    )

    # --- the record of the figures ------------------------------------------------------------

    trial = part(
        lambda self, nominal_seed: self.scratches.trial("nominal", self.shown_scratch(nominal_seed))
    )
    measured = part(lambda trial, gain: trial.record.f_en / gain)
    known = part(lambda trial, laws: [estimated(trial, laws[name, "known"]) for name in ESTIMATORS])

    def shown_scratch(self, nominal_seed: DataArray) -> ScratchDraw:
        """The scratch of the figures."""
        return ScratchDraw(int(nominal_seed[0]), PRINTED_ANGLE)

    @array(
        dims=(phase, size),
        unit="m",
        meaning="of the thesis' observer opened without delay, without noise",
    )
    def prompt_error_quiet(self, nominal_seed: DataArray, laws: dict[tuple[str, str], Any]) -> Any:
        scratch = self.shown_scratch(nominal_seed)
        trial = self.scratches.trial("nominal", scratch, noisy=False, prompt=True)
        return trial.errors(estimated(trial, laws["thesis", "known"]).outputs[:, 1])

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

    true_error = array(
        dims=zoomed, unit="m", meaning="", value=lambda trial, zoom: trial.error[zoom]
    )
    measured_error = array(
        dims=zoomed, unit="m", meaning="", value=lambda measured, zoom: measured[zoom]
    )
    quality = array(
        dims=zoomed, unit="1", meaning="", value=lambda trial, zoom: trial.quality[zoom]
    )
    shown = (estimator, zoomed)
    estimated_error = array(
        dims=shown,
        unit="m",
        meaning="",
        value=lambda known, zoom: [r.outputs[zoom, 1] for r in known],
    )
    effort_zoomed = array(
        dims=shown,
        unit="V",
        meaning="",
        value=lambda known, zoom: [r.disturbance[zoom] for r in known],
    )
    courses = (estimator, time)
    effort = array(
        dims=courses,
        unit="V",
        meaning="u_p",
        value=lambda known: _kept([one.disturbance for one in known]),
    )
    true_effort = array(
        dims=time,
        unit="V",
        meaning="",
        value=lambda self, time: self.true_u_p(time.values).astype("f4"),
    )

    adapted = part(
        lambda trial, laws: [
            estimated(trial, laws[name, "adapted"]).frequency_hz for name in RIVALS
        ]
    )
    followed = array(
        dims=(rival, time),
        unit="Hz",
        meaning="rotation frequency followed",
        value=lambda adapted: _kept(adapted),
    )
    followed_start = array(
        dims=(rival, early),
        unit="Hz",
        meaning="",
        value=lambda adapted: [one[EARLY] for one in adapted],
    )

    def true_u_p(self, time: RealArray) -> RealArray:
        """u_p [V] for a disc that has always turned: the control that makes the lens follow it."""
        bench = Laboratory(self.axis, "nominal")
        lens = bench.actuator.response([ROTATION])[0] * bench.coil_gain
        swing = red_book(self.axis).deviation / lens
        effort: RealArray = (swing * np.exp(2j * np.pi * ROTATION * time)).imag
        return effort

    K_obs = array(dims="state", value=lambda self: companion_gain(self.axis))
    K_obs_printed = array(
        dims="state", value=lambda self: PRINTED_K_OBS if self.axis == "focus" else None
    )

    @array(
        dims=(fixed, quality_level), unit="1/s", meaning="fastest growth at a quality that stays"
    )
    def growth(self) -> list[RealArray]:
        return [growth_rates(self.designed(name)) for name in FIXED]

    drive = dim(lambda self: [one.name for one in drives(self.axis, self.values)])

    seed = array(
        dims=(drive, draw),
        value=lambda self, drive, context: independent_seeds(context.rng, drive.size, self.draws),
    )

    @part
    def on_drives(self, seed: DataArray, gain: float, context: Context) -> list[Any]:
        """Errors of the rivals and of the measurement, and events, for each drive and draw."""
        rivals = [self.designed(name, "adapted").controller for name in RIVALS]
        optical = {one.name: one.K_optn for one in drives(self.axis, self.values)}

        def met(cell: tuple[str, int]) -> tuple[Any, Any, int]:
            name, one = (
                cell[0],
                self.scratches.trial(cell[0], ScratchDraw.drawn(self.axis, cell[1])),
            )
            # The estimator works in units of f_en: the drive's own optical gain converts them to
            # metres.
            scale = gain / optical[name]
            runs = [estimate(each, one.record.f_en, one.known, one.quality) for each in rivals]
            errors = [one.errors(scale * run.outputs[:, 1]) for run in runs]
            return errors, one.errors(one.record.f_en / optical[name]), len(one.record.events)

        cells = [
            (name, int(n)) for name, row in zip(optical, seed.values, strict=True) for n in row
        ]
        return context.spread(met, cells, "draws, all drives")

    drive_error = array(
        dims=(drive, draw, rival, phase, size),
        unit="m",
        meaning="",
        value=lambda self, on_drives: self.by_drive(on_drives, 0),
    )
    drive_measured = array(
        dims=(drive, draw, phase, size),
        unit="m",
        meaning="",
        value=lambda self, on_drives: self.by_drive(on_drives, 1),
    )
    events = array(dims=(drive, draw), value=lambda self, on_drives: self.by_drive(on_drives, 2))

    def by_drive(self, on_drives: list[Any], number: int) -> Any:
        """One result of all drives and draws (drives, draws, ...)."""
        every = np.array([one[number] for one in on_drives], np.float32)
        return every.reshape(-1, self.draws, *every.shape[1:])


def _kept(courses: list[RealArray]) -> Any:
    """The stored samples of whole runs, in single precision."""
    return np.array([one[KEPT] for one in courses], np.float32)


def growth_rates(estimator: Estimator | KalmanEstimator) -> RealArray:
    """Growth rate [1/s] of the slowest mode at each of QUALITIES, which scale the gain.

    estimator: one with constant gain.
    """
    assert isinstance(estimator, Estimator)
    radii = [abs(estimator.poles(quality=quality)).max() for quality in QUALITIES]
    return np.log(radii) / PERIOD
