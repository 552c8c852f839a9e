"""One start-up of the focus loop, and its outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workbench.errors import InputError

from ...drive.disc import Disc
from ...drive.photo_diodes import S_CURVE_PEAK, surface_of
from ...drive.tables import disc_formats, red_book
from ...laboratory.bench_setup import RATE, find_drive
from ...laboratory.experiment import Laboratory
from ...laboratory.record import Record
from ...tolerance.tactics import clean_level
from ..focus_search import BEGIN, END, RETREAT, WAIT, Search

LAWS = ("1/2 of its light", "1/2 of the nominal's", "1/20 of its light", "1/20, no noise")
"""Sums above which the focus counts as near: half of the drive's own level; half of the nominal
drive's; and so low that the disc's surface exceeds it, with the laboratory's noise and without.
"""
QUIET = {"noise": 0.0, "electronics": 0.0, "bits": None}
"""A laboratory without noise, whose converters do not round."""
OUTCOMES = ("captured", "lost", "surface", "dark", "never")
"""Outcomes of a start-up: the layer held; the layer passed and lost; the surface held; closed by
noise, without light; never closed.
"""
LAYER_OFFSET = 0.1e-3
"""Largest distance [m] of a flat layer from the resting lens, by assembly and clamping; a guess."""
ROTATION = 9.0
"""Rotation frequency [Hz] at the lead-in, where a disc starts."""
HOLDING = 40e-3
"""Time [s] for which the loop runs after the end of the full ramp."""
JUDGED = 5e-3
"""Time [s] at the end of a record in which it is judged whether the focus is held."""
NEAR = 3 * S_CURVE_PEAK
"""Distance [m] from the layer or the surface within which its light is seen."""


class Attempt(NamedTuple):
    """Outcome of one start-up.

    outcome: index in OUTCOMES. speed: relative speed of lens and layer [m/s] when the loop is
    closed, positive towards the disc; NaN if it is never closed. overshoot: largest error [m] after
    that, in the direction of motion.
    """

    outcome: int
    speed: float
    overshoot: float


@dataclass(frozen=True)
class StartUp:
    """Start-ups of drives by one of LAWS, at a speed of the ramp [m/s] and a share of the Red
    Book's deviation.
    """

    law: str
    speed: float
    share: float

    def laboratory(self, drive: str) -> Laboratory:
        return Laboratory("focus", drive, surface=True)

    def threshold(self, drive: str) -> float:
        """Sum [V] above which the focus counts as near. Raises InputError for an unknown law."""
        level = clean_level(self.laboratory(drive))
        nominal = find_drive("focus", "nominal")
        found = {
            LAWS[0]: 0.5 * level,
            LAWS[1]: 0.5 * nominal.K_opt / nominal.K_optn,
            LAWS[2]: 0.05 * level,
            LAWS[3]: 0.05 * level,
        }
        if self.law not in found:
            raise InputError(f"law is {self.law!r}; known: {', '.join(LAWS)}")
        return found[self.law]

    def disc(self, rng: np.random.Generator) -> Disc:
        """A disc at a random distance and angle; without deviation its rotation does not matter."""
        deviation = self.share * red_book("focus").deviation
        offset, phase = rng.uniform(-LAYER_OFFSET, LAYER_OFFSET), rng.uniform()
        rest = {"rotation": ROTATION, "phase": phase, "offset": offset, "run_up": 0.0}
        return Disc.along("focus", deviation, **rest)

    def record(self, drive: str, seed: int, **bench: object) -> Record:
        """A record of one draw; `bench` overrides fields of the laboratory."""
        search = Search(self.speed, self.threshold(drive))
        duration = -BEGIN / RETREAT + WAIT + (END - BEGIN) / self.speed + HOLDING
        bench = (QUIET if self.law == LAWS[3] else {}) | bench
        laboratory = replace(self.laboratory(drive), **bench)  # type: ignore[arg-type]
        disc = self.disc(np.random.default_rng(seed))
        return laboratory.closed_loop(search.cascade, duration=duration, disc=disc, seed=seed)

    def attempt(self, drive: str, seed: int, **bench: object) -> Attempt:
        """Outcome of one draw."""
        return outcome(self.record(drive, seed, **bench))


def outcome(record: Record) -> Attempt:
    """Outcome of a record."""
    error = record.x_cd - record.x
    closed = np.flatnonzero(record.signals["closed"] == 1.0)
    if not len(closed):
        return Attempt(OUTCOMES.index("never"), np.nan, np.nan)
    first = int(closed[0])
    depth, _ = surface_of(disc_formats()["CD"])
    last = error[-round(JUDGED * RATE) :]
    speed = float((error[first - 1] - error[first]) * RATE)
    if abs(last).max() < S_CURVE_PEAK:
        name = "captured"
    elif abs(last - depth).max() < S_CURVE_PEAK:
        name = "surface"
    else:
        seen = min(abs(error[first]), abs(error[first] - depth)) < NEAR
        name = "lost" if seen else "dark"
    place = depth if name == "surface" else 0.0
    return Attempt(OUTCOMES.index(name), speed, float(abs(error[first:] - place).max()))
