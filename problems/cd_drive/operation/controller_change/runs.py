"""One change of the controller in a running loop, and its effect on the error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from workbench.simulation import (
    Cascade,
    Controller,
    Part,
    blender,
    discrete_system,
    kernel,
    linear_controller,
    tracking_controller,
)
from workbench.types import RealArray, TransferFunction

from ...drive.disc import Disc
from ...drive.photo_diodes import CAPTURE
from ...drive.plants import controller
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD, RATE
from ...laboratory.experiment import MEASUREMENTS, Laboratory
from ...laboratory.record import Record

WAYS = ("from rest", "in parallel", "without a bump")
"""What the new controller did until the change: nothing; run beside the old one, with the same
error; or follow the old one's command, as `tracking_controller` does.
"""
ROTATION = 6.0
"""Rotation frequency [Hz]."""
SETTLED = 0.35
"""Time [s] from which a controller may be changed; the disc is at full deviation since 0.2 s."""
AFTER = 15e-3
"""Time [s] for which a change still moves the lens."""
STEP_AT = 30e-3
"""Time [s] of a step on a disc at rest; the loop has settled by then."""
FOLLOWING = 500.0
"""Rate [1/s] at which the new controller follows the command of the old one."""


class Changed(NamedTuple):
    """Effect of a change.

    difference: command of the new controller minus that of the old one at the change [V]. largest:
    largest error [m] after the change; before: largest error in the same time before it. lost:
    whether the focus or the track was lost.
    """

    difference: float
    largest: float
    before: float
    lost: float


@dataclass(frozen=True)
class Change:
    """Changes to the reference controller, from one with a gain that is lower by `old_db`.

    share: deviation of the disc over the Red Book's.
    """

    axis: Axis
    old_db: float
    share: float

    @cached_property
    def old(self) -> TransferFunction:
        return 10.0 ** (self.old_db / 20.0) * controller(self.axis)

    def cascade(self, way: str, time: float) -> Cascade:
        """Both controllers; the new one gives the command from this time [s] on."""
        new = controller(self.axis)
        parts = [
            Part("new", taken_at(time), []),
            Part("K_old", linear_controller(self.old, PERIOD), ["f_en"]),
        ]
        if way == "without a bump":
            follower = tracking_controller(new, PERIOD, FOLLOWING)
            parts.append(Part("K_new", follower, ["f_en", "new", "u_last"]))
        else:
            given = "f_en" if way == "in parallel" else "seen"
            parts += [Part("seen", blender(), ["new", "f_en"])]
            parts += [Part("K_new", linear_controller(new, PERIOD), [given])]
        return Cascade(MEASUREMENTS, [*parts, Part("u", blender(), ["new", "K_new", "K_old"])])

    def record(self, way: str, drive: str, angle: float, seed: int, **bench: object) -> Record:
        """Record of a change at an angle of the disc [revolutions]; `bench` overrides fields of the
        laboratory.
        """
        time = self.time(angle)
        deviation = self.share * red_book(self.axis).deviation
        disc = Disc.along(self.axis, deviation, rotation=ROTATION)
        laboratory = replace(Laboratory(self.axis, drive), **bench)  # type: ignore[arg-type]
        made = self.cascade(way, time)
        return laboratory.closed_loop(made, duration=time + AFTER, disc=disc, seed=seed)

    def time(self, angle: float) -> float:
        """Time [s] of a change at an angle of the disc [revolutions]."""
        turns = np.ceil(SETTLED * ROTATION - angle) + angle
        return float(round(turns / ROTATION * RATE) / RATE)

    def changed(self, way: str, drive: str, angle: float, seed: int, **bench: object) -> Changed:
        """Effect of one change."""
        record = self.record(way, drive, angle, seed, **bench)
        first = round(self.time(angle) * RATE)
        error = abs(record.x_cd - record.x)
        new, old = (float(record.signals[name][first]) for name in ("K_new", "K_old"))
        before = error[first - round(AFTER * RATE) : first]
        lost = error[first:].max() > CAPTURE[self.axis]
        return Changed(new - old, float(error[first:].max()), float(before.max()), float(lost))


def taken_at(time: float) -> Controller:
    """Part that returns 0 before a time [s], and 1 from then on."""
    parameters = np.array([round(time / PERIOD)], float)
    return Controller(_taken_at, np.zeros(1), parameters, dt=PERIOD)


def linear_step(axis: Axis, drive: str) -> float:
    """Largest error per volt of a step of the command [m/V], in the loop of the reference
    controller.
    """
    bench = Laboratory(axis, drive)
    model, K = bench.sampled_error(), discrete_system(controller(axis), PERIOD)
    x, memory, largest = np.zeros(model.nstates), np.zeros(K.nstates), 0.0
    for _ in range(round(AFTER * RATE)):
        read = float((model.C @ x)[0])
        largest = max(largest, abs(read))
        u = 1.0 + float((K.C @ memory)[0]) + float(K.D[0, 0]) * read
        memory = K.A @ memory + K.B[:, 0] * read
        x = model.A @ x + model.B[:, 0] * u
    return largest / bench.parameters.K_optn


def simulated_step(axis: Axis, drive: str, volts: float, seed: int, **bench: object) -> float:
    """Largest error [m] after a step of the command [V], on a disc at rest."""
    laboratory = replace(Laboratory(axis, drive), **bench)  # type: ignore[arg-type]
    first, last = round(STEP_AT * RATE), round((STEP_AT + AFTER) * RATE)
    excitation = np.where(np.arange(last) < first, 0.0, volts)
    record = laboratory.closed_loop(
        linear_controller(controller(axis), PERIOD), excitation, seed=seed
    )
    return float(abs(record.x_cd - record.x)[first:].max())


@kernel
def _taken_at(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `taken_at`; the state counts samples."""
    told[0] = 1.0 if state[0] >= parameters[0] else 0.0
    state[0] += 1.0
