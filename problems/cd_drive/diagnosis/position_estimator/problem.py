"""Positions and disturbances estimated while a scratch passes (sections 7.2.2 and 7.3.3).

Figure, equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, problem
from workbench.arrays import RealArray
from workbench.diagnosis import Estimator, KalmanEstimator, Rotation, estimate
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure

from ...drive.disc import VELOCITY
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values, drives, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from .checks import checks_of
from .model import (
    OBSERVER,
    PRINTED_K_OBS,
    SLOW,
    companion_gain,
    itae,
    kalman,
    of_the_thesis,
)
from .report import figures_of, numbers_of, tables_of
from .trials import ROTATION, SCRATCHED, Scratches, Trial

ADAPTATION, FLOOR = 10.0, 0.1
"""Rate of the frequency loop [1/s], a sixth of the oscillators' (see `Rotation`), and the control
effort [V] about which it fades."""
WINDOW = (-1.5e-3, 6.5e-3)
"""Shown about the start of the last defect but one [s]."""
STRIDE = 14
"""Of the samples kept of whole runs."""
QUALITIES = np.linspace(0.0, 1.0, 41)
FIXED = ("thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman settled")
"""Estimators of constant gain, scaled by the quality; the last is where the Kalman filter rests."""
ESTIMATORS = (*FIXED, "Kalman")
RIVALS = ("ITAE 300 Hz", "Kalman")
"""Taken on to all of the drives."""
CASES = ("known", "wrong", "adapted")
"""What the estimator believes of the rotation frequency."""


@problem(
    "cd/{axis}/position-estimator",
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def position_estimator(
    axis: Axis,
    length: Annotated[float, Field(gt=0, le=2.4e-3)] = 1.2e-3,
    depth: Annotated[float, Field(ge=0.6, le=0.9)] = 0.7,
    displacement: Annotated[float, Field(ge=0, le=1)] = 0.5,
    wrong: Annotated[float, Field(gt=0, le=0.3)] = 0.05,
    values: Values = "printed",
) -> PositionEstimator:
    """Positions and disturbance estimated through scratches (figures 7.14, 7.15, eq. 7.33-7.35).

    The virtual laboratory follows a disc of the largest deviation at 5.5 Hz with the mu-PID while
    scratches pass; the estimators read f_en and u, and a quality that opens them in a defect. The
    observer of the thesis, ITAE poles with oscillators placed, and a Kalman filter whose noise
    follows the quality; rotation known, wrong, and followed; then all twelve drives with the
    estimators of the nominal one.

    length [m], depth: of the scratches. displacement: their false one, in errors that can be read
    (2 um in focus, 0.2 um radially). wrong: relative error of the rotation. values: of the drives.
    """
    scratches = Scratches(axis, length, depth, displacement, values)
    return PositionEstimator(axis, scratches, wrong, values)


@dataclass(frozen=True)
class PositionEstimator(Study):
    """Estimators over recorded runs whose truth is known."""

    axis: Axis
    scratches: Scratches
    wrong: float
    values: Values

    headline: ClassVar[str] = "spike_kalman_um"

    def rotation(self, case: str) -> Rotation:
        frequency = ROTATION * (1.0 if case == "known" else 1.0 - self.wrong)
        return Rotation(frequency, adaptation=ADAPTATION * (case == "adapted"), floor=FLOOR)

    def estimator(self, name: str, case: str) -> Estimator | KalmanEstimator:
        rotation = self.rotation(case)
        if name == "thesis":
            return of_the_thesis(self.axis, rotation)
        if name.startswith("Kalman"):
            found = kalman(self.axis, rotation)
            return found if name == "Kalman" else found.settled
        return itae(self.axis, rotation, OBSERVER if name == "ITAE 5 kHz" else SLOW)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        seed = int(context.rng.integers(2**31))
        nominal = self.scratches.trial("nominal", seed)
        gain = Laboratory(self.axis, "nominal").parameters.K_optn
        found = {
            (name, case): estimate(
                self.estimator(name, case).controller,
                nominal.record.f_en,
                nominal.known,
                nominal.quality,
            )
            for name in ESTIMATORS
            for case in CASES
        }
        time = nominal.record.time
        last = np.flatnonzero(np.diff((nominal.record.light < 1.0).astype(int)) == 1)[-2]
        zoom = slice(last + round(WINDOW[0] * RATE), last + round(WINDOW[1] * RATE))
        every = slice(round(SCRATCHED * RATE), None, STRIDE)
        outcome = [
            [nominal.off(found[name, case].outputs[:, 1]) for case in CASES] for name in ESTIMATORS
        ]
        measured = nominal.off(nominal.record.f_en / gain)
        twelve = list(self._drives(seed, context))
        shown = [found[name, "known"] for name in ESTIMATORS]
        adapted = {name: found[name, "adapted"].frequency for name in RIVALS}
        prompt = [
            self._alone("thesis", self.scratches.trial("nominal", seed, noise, prompt=True))
            for noise in (None, 0.0)
        ]
        position = found["Kalman", "known"].outputs[:, 2] - nominal.record.x
        meter: dict[str, str] = {"units": "m"}
        printed = {"K_obs_printed": ("state", PRINTED_K_OBS)} if self.axis == "focus" else {}
        return xr.Dataset(
            {
                "error": (("estimator", "case", "phase", "size"), outcome, meter),
                "error_measured": (("phase", "size"), measured, meter),
                "drive_error": (
                    ("drive", "rival", "phase", "size"),
                    [sizes[:-1] for _, sizes, _ in twelve],
                    meter,
                ),
                "drive_measured": (
                    ("drive", "phase", "size"),
                    [sizes[-1] for _, sizes, _ in twelve],
                    meter,
                ),
                "prompt_error": (
                    ("noise", "phase", "size"),
                    prompt,
                    meter | {"long_name": "of the thesis' observer opened without delay"},
                ),
                "events": ("drive", [one for _, _, one in twelve]),
                "nominal_events": len(nominal.record.events),
                "false_alarms": int(((nominal.quality < 1) & (nominal.record.light == 1.0)).sum()),
                "missed": int(((nominal.quality > 0) & self.scratches.covered(nominal)).sum()),
                "position_error": ((), float(abs(position).max()), meter),
                "K_obs": ("state", companion_gain(self.axis)),
                **printed,
                "growth": (
                    ("fixed", "quality_level"),
                    [self._growth(name) for name in FIXED],
                    {"units": "1/s", "long_name": "fastest growth at a quality that stays"},
                ),
                "true_error": ("zoomed", nominal.error[zoom], meter),
                "measured_error": ("zoomed", nominal.record.f_en[zoom] / gain, meter),
                "quality": ("zoomed", nominal.quality[zoom], {"units": "1"}),
                "estimated_error": (
                    ("estimator", "zoomed"),
                    [one.outputs[zoom, 1] for one in shown],
                    meter,
                ),
                "effort_zoomed": (
                    ("estimator", "zoomed"),
                    [one.disturbance[zoom] for one in shown],
                    {"units": "V"},
                ),
                "effort": (
                    ("estimator", "time"),
                    np.array([one.disturbance[every] for one in shown], np.float32),
                    {"units": "V", "long_name": "u_p"},
                ),
                "true_effort": (
                    "time",
                    self._effort(time[every]).astype(np.float32),
                    {"units": "V"},
                ),
                "followed": (
                    ("rival", "time"),
                    np.array([one[every] for one in adapted.values()], np.float32),
                    {"units": "Hz", "long_name": "rotation frequency followed"},
                ),
                "followed_start": (
                    ("rival", "early"),
                    [one[: every.start : STRIDE] for one in adapted.values()],
                    {"units": "Hz"},
                ),
            },
            coords={
                "estimator": list(ESTIMATORS),
                "fixed": list(FIXED),
                "rival": list(RIVALS),
                "case": list(CASES),
                "phase": ["during", "after", "quiet"],
                "size": ["rms", "largest"],
                "drive": [name for name, _, _ in twelve],
                "quality_level": QUALITIES,
                "noise": ["present", "absent"],
                "zoomed": ("zoomed", 1e3 * (time[zoom] - time[last]), {"units": "ms"}),
                "time": ("time", time[every], {"units": "s"}),
                "early": ("early", time[: every.start : STRIDE], {"units": "s"}),
            },
        )

    def _drives(self, seed: int, context: Context) -> Iterator[tuple[str, list[Any], int]]:
        """Name, errors of the rivals and last of the measurement, and events, drive by drive."""
        rivals = [self.estimator(name, "adapted").controller for name in RIVALS]
        nominal_gain = Laboratory(self.axis, "nominal").parameters.K_optn
        for drive in context.track(list(drives(self.axis, self.values)), "drives"):
            one = self.scratches.trial(drive.name, seed)
            # The estimator works in units of f_en: the drive's own optical gain makes them metres.
            scale = nominal_gain / drive.K_optn
            runs = [estimate(each, one.record.f_en, one.known, one.quality) for each in rivals]
            sizes = [one.off(scale * run.outputs[:, 1]) for run in runs]
            sizes.append(one.off(one.record.f_en / drive.K_optn))
            yield drive.name, sizes, len(one.record.events)

    def _alone(self, name: str, trial: Trial) -> list[list[float]]:
        """Errors of an estimator that knows the rotation, in another trial."""
        streaming = self.estimator(name, "known").controller
        found = estimate(streaming, trial.record.f_en, trial.known, trial.quality)
        return trial.off(found.outputs[:, 1])

    def _growth(self, name: str) -> RealArray:
        """Rate [1/s] of the slowest decaying mode at qualities that stay, gains scaled by them."""
        fixed = self.estimator(name, "known")
        assert isinstance(fixed, Estimator)
        radii = [abs(fixed.poles(quality)).max() for quality in QUALITIES]
        return np.log(radii) / PERIOD

    def _effort(self, time: RealArray) -> RealArray:
        """u_p [V] of a disc that turns for ever: the control that makes the lens follow it."""
        bench = Laboratory(self.axis, "nominal")
        lens = bench.actuator.response([ROTATION])[0] * bench.coil_gain
        swing = red_book(self.axis).deviation / lens
        effort: RealArray = (swing * np.exp(2j * np.pi * ROTATION * time)).imag
        return effort

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return checks_of(answer, self.axis, ROTATION)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = numbers_of(answer)
        thesis = self.estimator("thesis", "known")
        assert isinstance(thesis, Estimator)
        numbers["K_p_settles_per_s"] = float(-np.log(abs(thesis.poles()).max()) / PERIOD)
        numbers["scratch_ms"] = 1e3 * self.scratches.length / VELOCITY
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer)

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis)
