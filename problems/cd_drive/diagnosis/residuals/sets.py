"""An incipient fault (a fading laser), and isolation of defects and shocks by signatures.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.diagnosis import confusion_matrix, cusum, isolate, quantile_threshold
from workbench.simulation import linear_controller, play
from workbench.study import independent_seeds
from workbench.types import RealArray

from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import Laboratory
from ..defect_kinds import SHOCK_DURATION, SHOCK_PEAK, draw
from ..defect_runs import SHOCK_PERIOD, DefectRun, run
from ..defect_statistics import high_passed, peaks

FADE = 0.05
"""Share of the light that the laser loses per second: ageing, accelerated."""
FADING = 4.0
"""Time [s] for which the laser is monitored."""
SLOW_DRIFT = 0.01
"""Drift of the slow cumulative sum, which ignores a loss of a hundredth."""
FAULTS = ("black dot", "scratch", "shock")
"""Faults that must be distinguished."""
RESIDUALS = ("sum", "fast error", "slow error")
"""Residuals that distinguish them."""
STRUCTURE = np.array([[True, True, False], [False, True, False], [False, False, True]])
"""True where a residual (row) responds to a fault (column)."""
SLOW_BAND = (30.0, 150.0)
"""Band [Hz] of the slow error: shocks are in it, the disc's rotation is below."""
COUNT = 20
"""Number of trials of each fault in a draw."""
RECORDS = 4
"""Number of records in a draw with a fading laser: in one the laser fades, the others give the
thresholds.
"""
ALARMS, BLOCK = 0.01, 350
"""False-alarm rate of each residual's threshold, per block of 10 ms."""


def _slow_sum(lost: RealArray) -> RealArray:
    return play(cusum(SLOW_DRIFT), lost[:, None])[:, 0]


WAYS: dict[str, Callable[[RealArray], RealArray]] = {
    "level": lambda lost: lost,
    "slow sum": _slow_sum,
}
"""Statistics of the lost share of light (N,) by which a fading laser is noticed."""


def fading(bench: Laboratory, seed: int) -> list[tuple[float, float]]:
    """Share of light lost when a fading laser is noticed, and threshold, for each of `WAYS`.

    The fault is incipient (section 7.1.2). Both diodes lose the same share, so the normalised
    error, and with it the loop, does not change: the loss is applied to the diodes of a finished
    record. Thresholds are the largest values on the other records, of the same length.
    """
    seeds = independent_seeds(np.random.default_rng(seed), RECORDS).tolist()
    own, *others = (_lost_light(run(bench, [], one, duration=FADING)) for one in seeds)
    level = [max(float(watched(one).max()) for one in others) for watched in WAYS.values()]
    return list(zip(lost_at_alarm(own, level), level, strict=True))


def lost_at_alarm(lost: RealArray, level: Sequence[float]) -> list[float]:
    """Share of light that the laser has lost at the alarm of each of `WAYS`; infinite without one.

    lost (N,): lost share of light on a record of a laser that does not fade.
    """
    share = FADE * np.arange(len(lost)) * PERIOD
    faded = 1.0 - (1.0 - lost) * (1.0 - share)
    above = [np.flatnonzero(f(faded) > at) for f, at in zip(WAYS.values(), level, strict=True)]
    return [float(share[places[0]]) if places.size else math.inf for places in above]


def lost_at_alarm_without_noise(bench: Laboratory, level: Sequence[float]) -> list[float]:
    """The same on a record without noise; `bench` is without noise."""
    return lost_at_alarm(_lost_light(run(bench, [], 0, duration=FADING)), level)


def _lost_light(one: DefectRun) -> RealArray:
    # The level is that of the disc at the start: a median of the fading record would follow the
    # loss.
    lost: RealArray = 1.0 - one.diodes.sum(axis=1)
    return lost


def residual_set(one: DefectRun) -> dict[str, RealArray]:
    """RESIDUALS over a run (N,): lost light, and the diodes' difference, high-passed and within
    SLOW_BAND.

    The difference is divided by the clean disc's level: divided by the diodes' own sum, the noise
    would grow as the light falls.
    """
    import control

    difference = one.diodes[:, 0] - one.diodes[:, 1]
    low, high = (2 * math.pi * corner for corner in SLOW_BAND)
    band = control.tf([high, 0.0], [1.0, low + high, low * high])
    slow = play(linear_controller(band, PERIOD), difference[:, None])[:, 0]
    return {
        "sum": _lost_light(one),
        "fast error": abs(high_passed(difference)),
        "slow error": abs(slow),
    }


def isolation(bench: Laboratory, seed: int) -> tuple[list[RealArray], NDArray[np.int64]]:
    """Isolation of black dots, scratches and shocks by the residuals that they make fire.

    Returns the share of each fault at which each residual fired (fault, residual), and for each
    fault how often it was taken for each one (fault, 4); the last column is none or several.
    """
    rng = np.random.default_rng(seed)
    quiet, dimmed, shaking = independent_seeds(rng, 3).tolist()
    clean = residual_set(run(bench, [], quiet, duration=FADING))
    level = [quantile_threshold(r, ALARMS, block=BLOCK).level for r in clean.values()]
    kinds = np.repeat([0, 1], COUNT)
    drawn = [draw(FAULTS[k], rng, bench.axis) for k in kinds]
    dirty = run(bench, drawn, dimmed)
    duration = SHOCK_PERIOD * (COUNT + 1) + 1e-3
    shaken = run(bench, [], shaking, SHOCK_PEAK[bench.axis], duration)
    starts = np.round(np.arange(COUNT) * SHOCK_PERIOD * RATE).astype(int).tolist()
    windows = [(start, start + round(SHOCK_DURATION * RATE)) for start in starts]
    fired = []
    for one, places in ((dirty, dirty.faults), (shaken, windows)):
        largest = np.array([peaks(r, places) for r in residual_set(one).values()])
        fired.append((largest > np.array(level)[:, None]).T)
    true = np.append(kinds, np.full(COUNT, 2))
    found = isolate(STRUCTURE, np.vstack(fired))
    share = [np.vstack(fired)[true == k].mean(axis=0) for k in range(len(FAULTS))]
    return share, confusion_matrix(true, found, len(FAULTS))
