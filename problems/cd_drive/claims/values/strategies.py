"""Strategies against defects, and arms of balloons (chapters 8 and 9)."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import Run

from ...drive.photo_diodes import CAPTURE
from ...drive.tables import Axis
from ...laboratory.bench_setup import find_drive
from .loops import DEFECTS
from .registry import value


@value
def false_reading(run: Run, axis: Axis) -> float:
    """Largest difference between normalised and true error in a scratch, over that elsewhere."""
    signals = run.data["zoom"].sel(strategy="reference").transpose("stage", "zoomed", "signal")
    false = abs(
        signals.sel(signal="f_en") / find_drive(axis, "nominal").K_optn
        - signals.sel(signal="error")
    )
    blind = signals.sel(signal="w_Q") < 0.5
    return float(false.where(blind).max() / false.where(~blind).max())


AFTER = 52
"""Samples after a defect over which the error's swing is read: 1.5 ms."""


@value
def swing(run: Run, strategy: str, signal: str, late: int) -> float:
    """Swing of a signal after the scratch over that before, one record with noise.

    `late`: how many times 1.5 ms after the end of the scratch the window begins."""
    shown = run.data["zoom"].sel(strategy=strategy, stage="after")
    bad = np.flatnonzero(shown.sel(signal="w_Q").values < 1)
    one = shown.sel(signal=signal).values
    start = bad[-1] + 1 + late * AFTER
    return float(np.ptp(one[start : start + AFTER]) / np.ptp(one[: bad[0]]))


@value
def ratio(run: Run, error: str, strategy: str, other: str = "reference") -> float:
    """Mean excursion or periodic error of a strategy over that of another one, nominal drive."""
    return run.metrics[f"{error}_{strategy}_mean"] / run.metrics[f"{error}_{other}_mean"]


@value
def share_below(run: Run, strategy: str) -> float:
    """Share of draws on all drives in which a strategy's excursion is below the reference's."""
    return float(run.data["smaller"].sel(strategy=strategy, other="reference"))


@value
def least_over_others(run: Run) -> float:
    """Mean excursion of the reference strategy over the largest mean of A, B and C, all drives."""
    mean = run.data["excursion"].mean(("drive", "draw"))
    return float(mean.sel(strategy="reference") / mean.sel(strategy=["A", "B", "C"]).max())


@value
def worse_at_red_book(run: Run, strategy: str) -> float:
    """Share of defects and draws on the Red Book's disc in which a strategy's error is larger."""
    peak = run.data["peak"].sel(share=1.0)
    return float((peak.sel(strategy=strategy) > peak.sel(strategy="reference")).mean())


@value
def worse_cells(run: Run, strategy: str) -> float:
    """Number of angles and lengths at which a strategy's mean error is larger than the
    reference's.
    """
    peak = run.data["peak"].sel(share=1.0).mean("draw")
    return float((peak.sel(strategy=strategy) > peak.sel(strategy="reference")).sum())


@value
def error_at_top(run: Run) -> float:
    """Error of a lens that stops, in a defect at the top of the deviation, over the largest such
    error.
    """
    standing = abs(run.data["standing"])
    return float(standing.sel(theta=np.pi / 2, method="nearest").max() / standing.max())


@value
def longest_at(run: Run, velocity: float) -> float:
    """Time [ms] of the longest defect that is repaired at a velocity [m/s]."""
    return 1000.0 * float(run.data["length"].max()) / velocity


@value
def crossovers(run: Run) -> float:
    """Crossover frequency with the filtered controller, over that with K, for the nominal drive."""
    size = (run.data["L_real"] ** 2 + run.data["L_imag"] ** 2) ** 0.5
    frequency = run.data["frequency"].values

    def crossover(controller: str) -> float:
        return float(frequency[size.sel(controller=controller).values >= 1][-1])

    return crossover("K (1 - F)") / crossover("K")


@value
def unstable_drives(run: Run, controller: str, sampling: str) -> float:
    """Number of the twelve drives that are unstable with a controller."""
    growth = run.data["growth"].sel(controller=controller, sampling=sampling)
    return float((growth.drop_sel(plant="nominal") > 0).sum())


REPAIRED = 2.5e-3
"""Longest burst [m of track] that the error code repairs (section 2.5.1)."""


@value
def repairable_defects_survived(run: Run, axis: Axis) -> float:
    """Share of angles and draws in which the reference strategy keeps focus or track over the
    longest repairable defect.
    """
    peak = run.data["peak"].sel(share=1.0, strategy="reference")
    longest = peak.sel(length=REPAIRED, method="nearest")
    return float((longest < CAPTURE[axis]).mean())


@value
def arm(run: Run, case: str, group: str) -> float:
    """An arm of the balloon of one controller."""
    return float(run.data["arm"].sel(case=case, group=group))


@value
def shocks_of_slow(run: Run) -> float:
    """Least excess of the slow controller's time out of spec in shocks over that by the disc alone,
    by their intervals.
    """
    ends = run.data["arm_interval"].sel(case="slow")
    return float(ends.sel(end="low", group="shocks") - ends.sel(end="high", group="disc deviation"))


@value
def shocks_of_fast(run: Run) -> float:
    """Share of time that the fast controller is out of spec in shocks."""
    return arm(run, "fast", "shocks")


def _arm(run: Run, use: str, gain: float) -> Any:
    """Share of time out of spec by cause, on all circumstances."""
    return run.data["arm"].sel(case=f"{use} {gain:+g} dB").mean("half")


@value
def in_defects(run: Run, use: str) -> float:
    """Time out of spec in defects at 2 dB more gain, over the reference strategy's at
    its own gain.
    """
    most, least = _arm(run, use, 2.0), _arm(run, "reference", 0.0)
    return float(most.sel(group=DEFECTS).mean() / least.sel(group=DEFECTS).mean())


@value
def called_bad(run: Run) -> float:
    """Share of the clean samples that the quality calls bad, over all draws."""
    return float(run.data["false_alarms"].sum() / run.data["clean"].sum())


@value
def over_reference(run: Run, name: str, error: str) -> float:
    """Mean error of a strategy over the draws, over that of the reference strategy."""
    return run.metrics[f"{error}_{name}_mean"] / run.metrics[f"{error}_reference_mean"]


@value
def reduced_in(run: Run, name: str) -> float:
    """Share of the draws with an unreadable reference in which a strategy's error is smaller."""
    return float(run.data["reduced"].sel(strategy=name, level=1.0))


@value
def spike_of_control(run: Run, name: str) -> float:
    """Range of u around the scratch under a strategy, over that under the reference strategy."""
    u = run.data["zoom"].sel(strategy=name, signal="u")
    before, after = (u.sel(stage=stage) for stage in ("before", "after"))
    return float((after.max() - after.min()) / (before.max() - before.min()))


@value
def causes(run: Run) -> float:
    """Number of causes that take more than 0.1 % of the time under the reference strategy,
    radially.
    """
    return float((run.data["arm"].sel(axis="radial", strategy="reference") > 1e-3).sum())


@value
def more_in_shocks(run: Run, strategy: str) -> float:
    """Time out of spec in shocks, a strategy minus the reference strategy at the same gain.

    The largest value over the gains from the printed one upwards at which the loops meet the
    standard.
    """
    return max(
        float((_arm(run, strategy, gain) - _arm(run, "reference", gain)).sel(group="shocks"))
        for gain in (0.0, 1.0, 2.0)
    )


@value
def larger_balloon(run: Run, strategy: str) -> float:
    """Largest balloon of a strategy minus that of the reference strategy at the same gain.

    It is taken over the gains from the printed one upwards at which the loops meet the standard.
    """

    def balloon(use: str, gain: float) -> float:
        return float(run.data["balloon"].sel(case=f"{use} {gain:+g} dB").mean("half"))

    return max(balloon(strategy, gain) - balloon("reference", gain) for gain in (0.0, 1.0, 2.0))
