"""Ways to read numbers of chapters 7 to 9: diodes, residuals, the fault filter, strategies."""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench import Run
from workbench.arrays import RealArray

from ..drive.tables import Axis, drives
from ..laboratory.bench_setup import PERIOD
from .items import Value

PLANE, RESIDUALS = "cd/{}/diode-plane", "cd/{}/residuals"
RAISED = "cd/raised-sum"
FILTER, ESTIMATOR = "cd/focus/fault-filter", "cd/focus/position-estimator"
STRATEGIES, EXCURSION = "cd/{}/strategies", "cd/{}/excursion"
SWITCHING, PLAYED = "cd/{}/switching-stability", "cd/playability"
AFTER = 52
"""Samples after a defect in which the error's swing is read: 1.5 ms."""

# --- the plane of the diodes ----------------------------------------------------------------------


def largest_other_sum(run: Run) -> float:
    """Largest mean sum, over the clean one, in defects of the kinds other than white dots."""
    means = run.data["raised"].mean(["draw", "axis", "drive"])
    return float(means.drop_sel(kind="white dot").max())


def lowest_sum(run: Run) -> float:
    """Lowest sum of the normalised diodes while a black dot passes."""
    return float(run.data["trace"].sel(kind="black dot").sum("diode").min())


def scratch_error(end: Literal["min", "max"]) -> Value:
    """Least or largest normalised error while a scratch passes."""

    def found(run: Run) -> float:
        one = run.data["trace"].sel(kind="scratch")
        return float(getattr(one.sel(diode="d1n") - one.sel(diode="d2n"), end)())

    return found


def least_diode(run: Run) -> float:
    """Least normalised signal of a diode, on clean discs and in defects."""
    return float(min(run.data[name].min() for name in ("clean", "shaken", "trace")))


def clean_inside(run: Run) -> float:
    """Share of the points of a clean disc with both diodes from 0.4 to 0.6."""
    clean = run.data["clean"]
    return float(((clean >= 0.4) & (clean <= 0.6)).all("diode").mean())


def missed_by(detector: str) -> Value:
    """Share of defects that a detector misses, mean over kinds."""
    return lambda run: float(run.data["missed"].sel(detector=detector).mean())


def alarms_of_sum(run: Run) -> float:
    """False alarms of the detectors that use the sum, over those of the error under shocks."""
    by_sum = run.data["false_alarms"].sel(detector=["binary", "quality"]).sum()
    return float(by_sum) / alarms_of_error(run)


def alarms_of_error(run: Run) -> float:
    """False alarms of the error under shocks."""
    return float(run.data["false_alarms"].sel(detector="error", condition="shock").sum())


def largest_coupling(run: Run) -> float:
    """Largest squared correlation of sum and error under shocks."""
    return float(run.data["coupling"].max())


def lead(run: Run) -> float:
    """How much sooner the quality signal is than the binary one, mean [samples]."""
    return float(run.data["lead"].mean()) / PERIOD


def drops_per_second(run: Run) -> float:
    """Rate at which the quality falls below a half [1/s]."""
    bad = (run.data["block_quality"].values < 0.5).astype(int)
    starts = run.data["block_time"].values[1:][np.diff(bad) == 1]
    return float((len(starts) - 1) / (starts[-1] - starts[0]))


def told_rightly(truth: str, found: str) -> Value:
    """Share of the defects or faults that are told for what they are."""

    def share(run: Run) -> float:
        every = run.data["confusion"]
        right = sum(float(every.sel({truth: n, found: n}).sum()) for n in every[truth].values)
        return right / float(every.sum())

    return share


# --- residuals and the fault filter ---------------------------------------------------------------


def missed_deep(statistic: str) -> Value:
    """Share of defects of 1 mm that take 40 % of the light and are missed."""

    def share(run: Run) -> float:
        one = run.data["missed"].sel(statistic=statistic, depth=0.4)
        return float(one.sel(length=1e-3, method="nearest").mean())

    return share


def lost_light(way: str) -> Value:
    """Share of the light that a fading laser has lost when a way of noticing it alarms, mean."""
    return lambda run: float(run.data["fade"].sel(way=way).mean())


def _matrices(run: Run) -> list[RealArray]:
    return [run.data[f"discrete_{name}"].values for name in "ABCD"]


def filter_gain(frequency: float) -> Value:
    """Gain [dB] of the sampled fault filter, metres to metres."""

    def gain(run: Run) -> float:
        A, B, C, D = _matrices(run)
        z = np.exp(2j * np.pi * frequency * float(run.data["discrete_dt"]))
        response = C @ np.linalg.solve(z * np.eye(len(A)) - A, B) + D
        return float(20 * np.log10(abs(response[0, 0])))

    return gain


def sensed_gain(frequency: float) -> Value:
    """The same from the normalised error, by the mean optical gain of Table A.3."""
    K_optn = np.mean([one.K_optn for one in drives("focus")])
    in_metres = filter_gain(frequency)
    assert callable(in_metres)
    return lambda run: in_metres(run) - float(20 * np.log10(K_optn))


def filter_pole(run: Run) -> float:
    """Largest modulus of a pole of the sampled fault filter."""
    return float(abs(np.linalg.eigvals(_matrices(run)[0])).max())


def gain_off(run: Run) -> float:
    """Largest relative deviation of the observer's gain from equation 7.34."""
    return float(abs(run.data["K_obs"] / run.data["K_obs_printed"] - 1).max())


# --- strategies -----------------------------------------------------------------------------------


def swing(strategy: str, signal: str, late: int) -> Value:
    """Swing of a signal after the scratch over that before, one record with noise.

    `late`: how many times 1.5 ms after the end of the scratch the window begins.
    """

    def ratio(run: Run) -> float:
        shown = run.data["zoom"].sel(strategy=strategy, stage="after")
        bad = np.flatnonzero(shown.sel(signal="w_Q").values < 1)
        one = shown.sel(signal=signal).values
        start = bad[-1] + 1 + late * AFTER
        return float(np.ptp(one[start : start + AFTER]) / np.ptp(one[: bad[0]]))

    return ratio


def ratio(error: str, strategy: str, other: str = "reference") -> Value:
    """Mean excursion or periodic error of a strategy over that of another one, nominal drive."""
    return lambda run: (
        run.metrics[f"{error}_{strategy}_mean"] / run.metrics[f"{error}_{other}_mean"]
    )


def share_below(strategy: str) -> Value:
    """Share of draws on all drives in which a strategy's excursion is below the reference's."""
    return lambda run: float(run.data["smaller"].sel(strategy=strategy, other="reference"))


def least_over_others(run: Run) -> float:
    """Mean excursion of the reference strategy over the largest mean of A, B and C, all drives."""
    mean = run.data["excursion"].mean(("drive", "draw"))
    return float(mean.sel(strategy="reference") / mean.sel(strategy=["A", "B", "C"]).max())


def worse_at_red_book(strategy: str) -> Value:
    """Share of defects and draws on the Red Book's disc in which a strategy errs more."""

    def share(run: Run) -> float:
        peak = run.data["peak"].sel(share=1.0)
        return float((peak.sel(strategy=strategy) > peak.sel(strategy="reference")).mean())

    return share


def worse_cells(strategy: str) -> Value:
    """Angles and lengths at which a strategy errs more than the reference in the mean of draws."""

    def count(run: Run) -> float:
        peak = run.data["peak"].sel(share=1.0).mean("draw")
        return float((peak.sel(strategy=strategy) > peak.sel(strategy="reference")).sum())

    return count


def error_at_top(run: Run) -> float:
    """Error of a lens that stops, in a defect at the top of the deviation, over the largest."""
    standing = abs(run.data["standing"])
    return float(standing.sel(theta=np.pi / 2, method="nearest").max() / standing.max())


def longest_at(velocity: float) -> Value:
    """Time [ms] of the longest defect that is repaired at a velocity [m/s]."""
    return lambda run: 1e3 * float(run.data["length"].max()) / velocity


def crossovers(run: Run) -> float:
    """Crossover frequency with the filtered controller over that with K, nominal drive."""
    size = (run.data["L_real"] ** 2 + run.data["L_imag"] ** 2) ** 0.5
    frequency = run.data["frequency"].values

    def crossover(controller: str) -> float:
        return float(frequency[size.sel(controller=controller).values >= 1][-1])

    return crossover("K (1 - F)") / crossover("K")


def unstable_drives(controller: str, sampling: str) -> Value:
    """How many of the twelve drives are unstable with a controller kept."""

    def count(run: Run) -> float:
        growth = run.data["growth"].sel(controller=controller, sampling=sampling)
        return float((growth.drop_sel(plant="nominal") > 0).sum())

    return count


def more_in_shocks(axis: Axis, strategy: str) -> Value:
    """Share of time out of spec in shocks, a strategy less the reference strategy."""

    def more(run: Run) -> float:
        arm = run.data["arm"].sel(axis=axis, known="shocks")
        return float(arm.sel(strategy=strategy) - arm.sel(strategy="reference"))

    return more
