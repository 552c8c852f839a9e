"""Diodes, residuals and the fault filter (chapter 7)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from workbench import Run
from workbench.diagnosis import LaguerreBasis
from workbench.types import DataArray, RealArray

from ...control.control_problem import performance_weight
from ...diagnosis.fault_filter.loop import LAGUERRE_POLE
from ...diagnosis.fault_filter.printed_weights import shock_weight
from ...diagnosis.position_estimator.model import Prototype
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import PERIOD
from ...tolerance.observer_bandwidth import prototype_changes
from .registry import value


@value
def largest_other_sum(run: Run) -> float:
    """Largest mean sum in defects other than white dots, over the clean sum."""
    means = run.data["raised"].mean(["draw", "axis", "drive"])
    return float(means.drop_sel(kind="white dot").max())


@value
def lowest_sum(run: Run) -> float:
    """Lowest sum of the normalised diodes while a black dot passes."""
    return float(run.data["trace"].sel(kind="black dot").sum("diode").min())


@value
def scratch_error(run: Run, end: Literal["min", "max"]) -> float:
    """Least or largest normalised error while a scratch passes."""
    one = run.data["trace"].sel(kind="scratch")
    return float(getattr(one.sel(diode="d1n") - one.sel(diode="d2n"), end)())


@value
def least_diode(run: Run) -> float:
    """Least normalised signal of a diode, on clean discs and in defects."""
    return float(min(run.data[name].min() for name in ("clean", "shaken", "trace")))


@value
def clean_inside(run: Run) -> float:
    """Share of the points of a clean disc with both diodes from 0.4 to 0.6."""
    clean = run.data["clean"]
    return float(((clean >= 0.4) & (clean <= 0.6)).all("diode").mean())


@value
def missed_by(run: Run, detector: str) -> float:
    """Share of defects that a detector misses, as a mean over kinds."""
    return float(run.data["missed"].sel(detector=detector).mean())


@value
def alarms_of_sum(run: Run) -> float:
    """False alarms under shocks of the detectors that use the sum, over those of the error."""
    by_sum = run.data["false_alarms"].sel(detector=["binary", "quality"]).sum()
    return float(by_sum) / alarms_of_error(run)


@value
def alarms_of_error(run: Run) -> float:
    """False alarms of the error under shocks."""
    return float(run.data["false_alarms"].sel(detector="error", condition="shock").sum())


@value
def largest_coupling(run: Run) -> float:
    """Largest squared correlation of sum and error under shocks."""
    return float(run.data["coupling"].max())


@value
def lead(run: Run) -> float:
    """Mean time [samples] by which the quality signal is earlier than the binary one."""
    return float(run.data["lead"].mean()) / PERIOD


@value
def drops_per_second(run: Run) -> float:
    """Rate at which the quality falls below a half [1/s]."""
    bad = (run.data["block_quality"].values < 0.5).astype(int)
    starts = run.data["block_time"].values[1:][np.diff(bad) == 1]
    return float((len(starts) - 1) / (starts[-1] - starts[0]))


@value
def told_rightly(run: Run, truth: str, found: str) -> float:
    """Share of the defects or faults whose kind is recognised."""
    every = run.data["confusion"]
    right = sum(float(every.sel({truth: n, found: n}).sum()) for n in every[truth].values)
    return right / float(every.sum())


@value
def missed_deep(run: Run, statistic: str) -> float:
    """Share of defects of 1 mm that take 40 % of the light and are missed."""
    one = run.data["missed"].sel(statistic=statistic, depth=0.4)
    return float(one.sel(length=1e-3, method="nearest").mean())


@value
def lost_light(run: Run, way: str) -> float:
    """Mean share of the light that a fading laser has lost when one way of noticing it alarms."""
    return float(run.data["fade"].sel(way=way).mean())


def _matrices(run: Run) -> list[RealArray]:
    return [run.data[f"discrete_{name}"].values for name in "ABCD"]


@value
def filter_gain(run: Run, frequency: float) -> float:
    """Gain [dB] of the sampled fault filter, metres to metres."""
    A, B, C, D = _matrices(run)
    z = np.exp(2j * np.pi * frequency * float(run.data["discrete_dt"]))
    response = C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D
    return float(20 * np.log10(abs(response[0, 0])))


@value
def sensed_gain(run: Run, frequency: float) -> float:
    """The same for the normalised error, with the mean optical gain of Table A.3."""
    K_optn = np.mean([one.K_optn for one in drives("focus")])
    return filter_gain(run, frequency) - float(20 * np.log10(K_optn))


@value
def filter_pole(run: Run) -> float:
    """Largest modulus of a pole of the sampled fault filter."""
    return float(abs(np.linalg.eigvals(_matrices(run)[0])).max())


@value
def gain_off(run: Run) -> float:
    """Largest relative deviation of the observer's gain from equation 7.34."""
    return float(abs(run.data["K_obs"] / run.data["K_obs_printed"] - 1).max())


@value
def slow_over_level(run: Run) -> float:
    """Light that a fading laser has lost when a slow sum alarms, over that when a level alarms."""
    return lost_light(run, "slow sum") / lost_light(run, "level")


@value
def least_quality(run: Run) -> float:
    """Least quality in a scratch."""
    return float(run.data["zoom_quality"].min())


@value
def graded_samples(run: Run) -> float:
    """Number of samples in a scratch with a quality between 0.01 and 0.99."""
    quality = run.data["zoom_quality"]
    return float(((quality > 0.01) & (quality < 0.99)).sum())


@value
def least_leakage(run: Run, error: float) -> float:
    """Lower bound on the leakage [m] of every filter at a relative error."""
    return float(run.data["least_total"].sel(point=error, method="nearest"))


@value
def reached_leakage(run: Run, error: float, functions: int) -> float:
    """Leakage and noise [m] that a filter of so many Laguerre functions reaches at a relative
    error, nominal plant.
    """
    study: Any = run.task  # FaultFilterStudy
    front, _ = study.fronts("full", float(run.data["set_share"]))
    basis = LaguerreBasis(study.loops["full"], LAGUERRE_POLE)
    point = front.least(basis.response(front.omega, functions), error)
    return point.leakage + 3 * point.noise


@value
def thesis_spike(run: Run, quality: str) -> float:
    """Spike [um] of the thesis' estimator after a scratch, as a mean over the draws.

    quality: as in the table of readings; "prompt" is exact at every sample.
    """
    return 1e6 * float(_thesis_error(run, quality).sel(phase="after").mean())


@value
def thesis_during(run: Run, quality: str) -> float:
    """Mean largest error of the thesis' estimator in a scratch, over that of the measurement."""
    measured = run.data["error_measured"].sel(phase="during", size="largest")
    return float(_thesis_error(run, quality).sel(phase="during").mean() / measured.mean())


def _thesis_error(run: Run, quality: str) -> DataArray:
    """Largest errors of the thesis' estimator (draw, phase)."""
    if quality == "prompt":
        return run.data["prompt_error"].sel(size="largest")
    return run.data["error"].sel(estimator="thesis", case="known", size="largest")


@value
def by_scaling(run: Run, metric: str, scaling: str) -> float:
    """A metric of the filter by the printed numbers, under a reading of their scalings."""
    return float(run.metrics[f"{metric}_{scaling}"])


@value
def printed_gain(run: Run, scaling: str, frequency: float) -> float:
    """Gain [dB] at a frequency [Hz] of the filter by the printed numbers, metres to metres."""
    one, s = run.data.sel(design=scaling), 2j * np.pi * frequency
    roots = (s - one[name].values for name in ("zeros", "poles"))
    above, below = (float(np.log10(abs(root)).sum()) for root in roots)
    return float(20 * (np.log10(abs(one["gain"])) + above - below))


@value
def error_growth(run: Run, scaling: str, longer: float, shorter: float) -> float:
    """Error of the estimate of a longer bump over that of a shorter one [mm], worst drives."""
    worst = run.data["error"].sel(design=scaling).max("drive")
    return float(worst.sel(length=longer) / worst.sel(length=shorter))


@value
def shock_over_weight(run: Run) -> float:
    """Largest ratio of a shock's weight to W_p of the filter, from 1 Hz to 10 kHz."""
    axis, omega = _axis(run), 2 * np.pi * np.geomspace(1.0, 10e3, 400)
    shock, disc = (abs(one(1j * omega)) for one in (shock_weight(axis), performance_weight(axis)))
    return float((shock / disc).max())


@value
def prototype_change(run: Run, kind: Prototype) -> float:
    """Largest relative change of a loop's bandwidth by an observer of 5 kHz with these poles."""
    return float(abs(prototype_changes(_axis(run), kind)).max())


def _axis(run: Run) -> Axis:
    return "focus" if "/focus/" in run.problem else "radial"
