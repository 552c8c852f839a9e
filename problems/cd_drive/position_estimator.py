"""Positions and disturbances estimated while a scratch passes (sections 7.2.2 and 7.3.3).

Figure, equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from workbench import Check, Study, problem
from workbench.diagnosis import Estimate, Estimator, KalmanEstimator, Rotation, estimate
from workbench.executor import Context
from workbench.simulation import linear

from .actuator import Real
from .bench_setup import PERIOD, RATE
from .disc import VELOCITY, Defect, Disc
from .drives import controller
from .laboratory import Laboratory
from .position_checks import checks_of
from .position_model import (
    OBSERVER,
    PRINTED_K_OBS,
    SLOW,
    companion_gain,
    itae,
    kalman,
    of_the_thesis,
    quality,
)
from .position_report import figures_of, tables_of
from .record import Record
from .red_book import ACCEPTABLE_ERROR
from .sets import TABLES
from .tables import Axis, Values, drives, red_book

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

ROTATION = 5.5
"""Of the disc [Hz], near the average (section 7.3)."""
DURATION, SCRATCHED, EVALUATED = 1.5, 0.3, 0.55
"""Length of a run, from when the disc is scratched and from when errors count [s]."""
ADAPTATION, FLOOR = 10.0, 0.1
"""Rate of the frequency loop [1/s], a sixth of the oscillators' (see `Rotation`), and the control
effort [V] about which it fades."""
AFTER = 5e-3
"""How long after a defect errors count as its aftermath [s]."""
WINDOW = (-1.5e-3, 6.5e-3)
"""Shown about the start of the last defect but one [s]."""
STRIDE = 14
"""Of the samples kept of whole runs."""
QUALITIES = np.linspace(0.0, 1.0, 41)
ESTIMATORS = ("thesis", "ITAE 5 kHz", "ITAE 300 Hz", "Kalman")
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
    depth: Annotated[float, Field(ge=0.5, le=0.9)] = 0.7,
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
    return PositionEstimator(axis, length, depth, displacement, wrong, values)


class Trial(NamedTuple):
    """A recorded run, what an estimator is given of it, and which samples count.

    during: quality below 1; after: the samples that follow it for AFTER; quiet: the others.
    """

    record: Record
    known: Real
    quality: Real
    error: Real
    during: Any
    after: Any
    quiet: Any


@dataclass(frozen=True)
class PositionEstimator(Study):
    """Estimators over recorded runs whose truth is known."""

    axis: Axis
    length: float
    depth: float
    displacement: float
    wrong: float
    values: Values

    headline: ClassVar[str] = "spike_kalman_um"

    @property
    def defect(self) -> Defect:
        false = self.displacement * ACCEPTABLE_ERROR[self.axis]
        return Defect(
            self.length, 0.25, self.depth, displacement=false, present=(SCRATCHED, np.inf)
        )

    def rotation(self, case: str) -> Rotation:
        frequency = ROTATION * (1.0 if case == "known" else 1.0 - self.wrong)
        return Rotation(frequency, adaptation=ADAPTATION * (case == "adapted"), floor=FLOOR)

    def estimator(self, name: str, case: str) -> Estimator | KalmanEstimator:
        rotation = self.rotation(case)
        if name == "thesis":
            return of_the_thesis(self.axis, rotation)
        if name == "Kalman":
            return kalman(self.axis, rotation)
        return itae(self.axis, rotation, OBSERVER if name == "ITAE 5 kHz" else SLOW)

    def trial(self, drive: str, seed: int) -> Trial:
        """The mu-PID on a drive; delay: the computer's one sample."""
        bench = Laboratory(self.axis, drive, self.values, delay=1.0)
        size = (red_book(self.axis).deviation,)
        disc = Disc(
            warp=size if self.axis == "focus" else (),
            eccentricity=size if self.axis == "radial" else (),
            rotation=ROTATION,
        )
        law = linear(controller(self.axis), PERIOD)
        record = bench.closed_loop(
            law, duration=DURATION, disc=disc, defects=[self.defect], seed=seed
        )
        optics = bench.parameters
        seen = quality(record, optics.K_opt / optics.K_optn)
        counted = record.time >= EVALUATED
        during = counted & (seen < 1.0)
        recent = np.convolve(seen < 1.0, np.ones(round(AFTER * RATE)))[: len(seen)] > 0
        after = counted & recent & ~during
        acting = np.concatenate([[0.0], record.u_dac[:-1]])  # the converter's output comes late
        error = record.x_cd - record.x
        return Trial(record, acting, seen, error, during, after, counted & ~during & ~after)

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        seed = int(context.rng.integers(2**31))
        nominal = self.trial("nominal", seed)
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
            [_sizes(found[name, case].outputs[:, 1], nominal) for case in CASES]
            for name in ESTIMATORS
        ]
        measured = _sizes(nominal.record.f_en / gain, nominal)
        twelve = list(self._drives(seed, context))
        shown = [found[name, "known"] for name in ESTIMATORS]
        adapted = {name: found[name, "adapted"].frequency for name in RIVALS}
        position = found["Kalman", "known"].outputs[:, 2] - nominal.record.x
        meter: dict[str, str] = {"units": "m"}
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
                "events": ("drive", [one for _, _, one in twelve]),
                "nominal_events": len(nominal.record.events),
                "false_alarms": int(((nominal.quality < 1) & (nominal.record.light == 1.0)).sum()),
                "missed": int(((nominal.quality > 0) & _covered(nominal, self.depth)).sum()),
                "position_error": ((), float(abs(position).max()), meter),
                "K_obs": ("state", companion_gain(self.axis)),
                "K_obs_printed": ("state", PRINTED_K_OBS),
                "growth": (
                    ("estimator_of_constant_gain", "quality_level"),
                    [self._growth(name) for name in ESTIMATORS],
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
                "estimator_of_constant_gain": list(ESTIMATORS),
                "rival": list(RIVALS),
                "case": list(CASES),
                "phase": ["during", "after", "quiet"],
                "size": ["rms", "largest"],
                "drive": [name for name, _, _ in twelve],
                "quality_level": QUALITIES,
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
            one = self.trial(drive.name, seed)
            # The estimator works in units of f_en: the drive's own optical gain makes them metres.
            scale = nominal_gain / drive.K_optn
            runs = [estimate(each, one.record.f_en, one.known, one.quality) for each in rivals]
            sizes = [_sizes(scale * run.outputs[:, 1], one) for run in runs]
            sizes.append(_sizes(one.record.f_en / drive.K_optn, one))
            yield drive.name, sizes, len(one.record.events)

    def _growth(self, name: str) -> Real:
        """Rate [1/s] of the slowest decaying mode at qualities that stay, gains scaled by them."""
        found = self.estimator(name, "known")
        fixed = found.settled if isinstance(found, KalmanEstimator) else found
        n = fixed.model.seen
        A, C = fixed.model.A[:n, :n], fixed.model.C[:n]
        radii = [
            abs(np.linalg.eigvals(A - w * np.outer(A @ fixed.gain, C))).max() for w in QUALITIES
        ]
        return np.log(radii) / PERIOD

    def _effort(self, time: Real) -> Real:
        """u_p [V] of a disc that turns for ever: the control that makes the lens follow it."""
        bench = Laboratory(self.axis, "nominal")
        lens = bench.actuator.response([ROTATION])[0] * bench.coil_gain
        swing = red_book(self.axis).deviation / lens
        effort: Real = (swing * np.exp(2j * np.pi * ROTATION * time)).imag
        return effort

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        return checks_of(answer, self.axis, ROTATION)

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
        um = 1e6 * answer["error"]
        numbers = {}
        for name in ESTIMATORS:
            for case in CASES:
                word = "_".join([*name.lower().split(), *([] if case == "known" else [case])])
                one = um.sel(estimator=name, case=case)
                numbers[f"spike_{word}_um"] = float(one.sel(phase="after", size="largest"))
                numbers[f"during_{word}_um"] = float(one.sel(phase="during", size="largest"))
                numbers[f"rms_quiet_{word}_um"] = float(one.sel(phase="quiet", size="rms"))
            level = answer["growth"].sel(estimator_of_constant_gain=name)
            numbers[f"growth_{'_'.join(name.lower().split())}_per_s"] = float(level.max())
        for phase in ("during", "after", "quiet"):
            measured = 1e6 * answer["error_measured"].sel(phase=phase)
            numbers[f"{phase}_measured_um"] = float(measured.sel(size="largest"))
        for name in RIVALS:
            word = "_".join(name.lower().split())
            one = 1e6 * answer["drive_error"].sel(rival=name, size="largest").max("drive")
            numbers[f"drives_during_{word}_um"] = float(one.sel(phase="during"))
            numbers[f"drives_spike_{word}_um"] = float(one.sel(phase="after"))
            numbers[f"followed_{word}_hz"] = float(answer["followed"].sel(rival=name)[-1])
        worst = 1e6 * answer["drive_measured"].sel(size="largest").max("drive")
        numbers["drives_during_measured_um"] = float(worst.sel(phase="during"))
        if self.axis == "focus":
            off = answer["K_obs"] / answer["K_obs_printed"] - 1
            numbers |= {
                f"K_obs_{k + 1}_deviation": float(value) for k, value in enumerate(off.values)
            }
        numbers["scratch_ms"] = 1e3 * self.length / VELOCITY
        return numbers

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        return tables_of(answer, self.axis)

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis)


def _sizes(estimated: Real, trial: Trial) -> list[list[float]]:
    """Rms and largest error [m] during defects, after them and otherwise."""
    off = estimated - trial.error
    return [
        [float(np.sqrt(np.mean(off[where] ** 2))), float(abs(off[where]).max())]
        for where in (trial.during, trial.after, trial.quiet)
    ]


def _covered(trial: Trial, depth: float) -> Any:
    """Where a scratch has taken nearly all of the light that it takes."""
    return trial.record.light < 1.0 - 0.95 * depth


__all__ = ["Estimate", "PositionEstimator", "position_estimator"]
