"""A scratch passes once in a plain loop, without any detector, with controllers of several gains.

Equation, figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from workbench.simulation import Controller, linear_controller
from workbench.types import RealArray, StateSpace

from ...diagnosis.scratch_draws import ScratchDraw
from ...drive.disc import VELOCITY, Defect, Disc
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import PERIOD, RATE, find_drive
from ...laboratory.record import Record
from ..bench_reading import BenchReading

MET = 0.45
"""Time [s] at which the scratch begins; the disc is at full deviation since 0.2 s."""
AFTER = 10e-3
"""Time [s] after the scratch in which it still moves the lens."""
ROTATION = 6.0
"""Rotation frequency [Hz] of figure 6.7."""
SHOWN_BEFORE = 40e-3
"""Time [s] before a scratch at which a shown record begins."""
THIRD = "third gain"
"""The controller of the lower graphs of figure 6.7."""
CONTROLLERS = ("full gain", THIRD, "K'")
"""Reference controller with its own gain and with a third of it, and the one designed for defects.
"""


class Reaction(NamedTuple):
    """Error of a loop by a disc and a scratch.

    disc: amplitude of the true error [m] at the rotation frequency, without the scratch. scratch:
    largest displacement [m] that it causes, compared with the same run without it. both: largest
    true error [m] from the scratch on. control: largest change of u [V] that the scratch causes.
    lost: whether the error left the capture range.
    """

    disc: float
    scratch: float
    both: float
    control: float
    lost: float


@dataclass(frozen=True, eq=False)
class PlainLoop:
    """The loop of one drive on a disc with a scratch, as in figure 6.7.

    slower: discrete K' of `cd/<axis>/lower-bandwidth`. depth: share of the light that a scratch
    takes. swing: its false displacement, over the acceptable error. reading: of what the
    text leaves open about the bench.
    """

    axis: Axis
    slower: StateSpace
    drive: str
    depth: float
    swing: float
    reading: BenchReading = field(default_factory=BenchReading)

    @cached_property
    def laws(self) -> dict[str, Controller]:
        """The controllers by name; each gets only the measured error."""
        K = controller(self.axis)
        every = dict(zip(CONTROLLERS, (K, K / 3, self.slower), strict=True))
        return {name: linear_controller(one, PERIOD) for name, one in every.items()}

    def record(
        self, law: str, share: float, length: float, scratch: ScratchDraw, met: bool
    ) -> Record:
        """Simulate a disc with a share of the Red Book's deviation, with or without the scratch."""
        deviation = share * red_book(self.axis).deviation
        disc = Disc.along(self.axis, deviation, rotation=ROTATION, phase=scratch.angle)
        defect = Defect(
            length=length,
            angle=(ROTATION * MET + scratch.angle) % 1.0,
            depth=self.depth,
            displacement=scratch.sign * self.swing * ACCEPTABLE_ERROR[self.axis],
            edge=scratch.edge,
            present=(MET - 1e-6, MET + 1.5 * length / VELOCITY),
        )
        return self.reading.laboratory(self.axis, self.drive).closed_loop(
            self.laws[law],
            duration=MET + length / VELOCITY + AFTER,
            disc=disc,
            defects=[defect] if met else [],
            seed=scratch.seed,
        )

    def reaction(self, law: str, share: float, length: float, scratch: ScratchDraw) -> Reaction:
        """Compare the same disc and noise with and without a scratch."""
        without, with_it = (self.record(law, share, length, scratch, met) for met in (False, True))
        start = round(MET * RATE)
        turn = slice(start - round(RATE / ROTATION), start)
        wave = np.exp(-2j * np.pi * ROTATION * without.time[turn])
        return Reaction(
            float(2.0 * abs(np.mean(_error(without)[turn] * wave))),
            float(abs(with_it.x - without.x).max()),
            float(abs(_error(with_it)[start:]).max()),
            float(abs(with_it.u - without.u).max()),
            float(bool(with_it.events)),
        )

    def shown(self, law: str, share: float, length: float, scratch: ScratchDraw) -> RealArray:
        """Measured and true error [m] and u [V] around a scratch: (3, times)."""
        record = self.record(law, share, length, scratch, True)
        K_optn = find_drive(self.axis, self.drive).K_optn
        signals = np.array([record.f_en / K_optn, _error(record), record.u])
        return signals[:, -len(self.shown_times(length)) :]

    def shown_times(self, length: float) -> RealArray:
        """Times [s] of a shown record, from the start of the scratch."""
        samples = round((MET + length / VELOCITY + AFTER) * RATE)
        time = np.arange(samples) / RATE - MET
        return time[time >= -SHOWN_BEFORE]


def _error(record: Record) -> RealArray:
    """The true error [m], which a player cannot measure."""
    error: RealArray = record.x_cd - record.x
    return error
