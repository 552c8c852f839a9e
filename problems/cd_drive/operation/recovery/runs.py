"""One loss of a loop, and the time until the data are back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from workbench.simulation import (
    Cascade,
    Controller,
    Part,
    blender,
    kernel,
    linear_controller,
    tracking_controller,
)
from workbench.types import RealArray

from ...drive.photo_diodes import CAPTURE, TRACK_PITCH
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import MEASUREMENTS, Laboratory
from ...laboratory.record import Record
from ...tolerance.tactics import clean_level
from ..focus_search import FOLLOWING, Search
from .causes import AT, defects, disc, ends, excitation

DARK = 0.5
"""Share of its light on a clean disc below which a drive counts as dark."""
DURATION = {"focus": 1.8, "radial": 1.0}
"""Length of a run [s]: of the focus, two searches."""
CALM = 5e-3
"""Time [s] for which the error has to stay acceptable until the data count as back."""
NEVER = np.nan
"""Time of what does not happen within a run."""


class Recovered(NamedTuple):
    """What a cause did.

    lost: whether the error left the capture range while the loop was closed. away: tracks from its
    own one to the one on which the loop ends. searches: number of times the loop was opened.
    detected: time [s] from the cause to the first of them. back: time [s] from the cause until the
    error stays acceptable, on whatever track; NaN if it does not within the run.
    """

    lost: float
    away: float
    searches: float
    detected: float
    back: float


@dataclass(frozen=True)
class Recovery:
    """Runs of an axis with this patience [s] in the dark, and this speed of a search [m/s]."""

    axis: Axis
    patience: float
    speed: float

    def record(self, drive: str, cause: str, seed: int, **fields: Any) -> Record:
        """A record of one draw, with the loop closed from the start; `fields` are those of the
        laboratory.
        """
        bench = Laboratory(self.axis, drive, surface=self.axis == "focus", **fields)
        samples = round(DURATION[self.axis] * RATE)
        met = disc(self.axis, np.random.default_rng(seed))
        spots = defects(self.axis, cause, met, ACCEPTABLE_ERROR[self.axis])
        force = excitation(bench, cause, samples)
        light = DARK * clean_level(bench)
        made = self.searching(light) if self.axis == "focus" else held_in_the_dark(light)
        return bench.closed_loop(made, force, disc=met, defects=spots, seed=seed)

    def searching(self, light: float) -> Cascade:
        """The reference controller, and the search that takes over when it has lost the focus.

        In the dark the controller reads an error of 0, as the defect detector of figure 2.14
        arranges.
        """
        search = Search(self.speed, light, self.patience, closed=True)
        follower = tracking_controller(controller("focus"), PERIOD, FOLLOWING)
        parts = [
            Part("search", search.law, inputs=["f_en", "sum"], outputs=["closed", "ramp"]),
            Part("lit", lit(light), inputs=["sum", "closed"]),
            Part("seen", blender(), inputs=["lit", "f_en"]),
            Part("K", follower, inputs=["seen", "closed", "u_last"], outputs=["u_k"]),
            Part("u", blender(), inputs=["closed", "u_k", "ramp"]),
        ]
        return Cascade(MEASUREMENTS, parts)

    def recovered(self, drive: str, cause: str, seed: int, **fields: Any) -> Recovered:
        """What a cause did in one draw."""
        return outcome(self.record(drive, cause, seed, **fields), self.axis, cause)


def held_in_the_dark(light: float) -> Cascade:
    """The radial reference controller, which reads an error of 0 in the dark."""
    law = linear_controller(controller("radial"), PERIOD)
    parts = [
        Part("lit", lit(light), inputs=["sum"]),
        Part("seen", blender(), inputs=["lit", "f_en"]),
        Part("u", law, inputs=["seen"]),
    ]
    return Cascade(MEASUREMENTS, parts)


def lit(light: float) -> Controller:
    """Part that reads the sum [V], and whether the loop is closed; 1 if it is, and not dark."""
    return Controller(_lit, np.zeros(0), np.array([light]), reads=1, dt=PERIOD)


def outcome(record: Record, axis: Axis, cause: str) -> Recovered:
    """What a cause did in a record."""
    first, over = round(AT * RATE), round(ends(cause) * RATE)
    error = (record.x_cd - record.x)[first:]
    own = round(float(error[-round(CALM * RATE) :].mean()) / TRACK_PITCH) if axis == "radial" else 0
    # of a loop that ends on another track, from the middle of that one
    off = abs(error - own * TRACK_PITCH) > ACCEPTABLE_ERROR[axis]
    late = np.flatnonzero(off)
    settled = not late.size or late[-1] + 1 <= len(off) - round(CALM * RATE)
    last = (late[-1] + 1) / RATE if late.size else 0.0
    closed = record.signals.get("closed", np.ones(len(record.x)))[first:]
    opened = np.flatnonzero(np.diff(closed) < 0.0)
    return Recovered(
        lost=float(abs(error[: opened[0] if len(opened) else None]).max() > CAPTURE[axis]),
        away=float(-own),
        searches=float(len(opened)),
        detected=float(opened[0] / RATE) if len(opened) else NEVER,
        back=max(last, (over - first) / RATE) if settled else NEVER,
    )


def thinned(record: Record, every: int) -> tuple[RealArray, RealArray]:
    """Time [s] from the cause, and error [m], sum over its largest, and voltage [V] (3, N), of
    every so many samples around a loss.
    """
    inside = slice(round((AT - 0.02) * RATE), round((AT + 0.5) * RATE), every)
    signals = [record.x_cd - record.x, record.sum / record.sum.max(), record.u]
    return record.time[inside] - AT, np.array([one[inside] for one in signals], np.float32)


@kernel
def _lit(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `lit`."""
    closed = given[1] if len(given) > 1 else 1.0
    told[0] = closed if given[0] > parameters[0] else 0.0
