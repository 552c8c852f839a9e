"""The loops of the twelve drives of an axis, whose controllers are switched by defects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench.synthesis import (
    Deviations,
    Mode,
    SampledPlant,
    SwitchedBox,
    SwitchedLoop,
    SwitchedStability,
    switched_loop,
)
from workbench.types import RealArray, StateSpace

from ...control.loops import plants
from ...drive.disc import VELOCITY
from ...drive.plants import Gain, controller, total_gains
from ...drive.red_book import ACCEPTABLE_ERROR, corners, envelope
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import RATE
from ..switched_loop import MICRO, lens_model, regulators
from .box import parametric_box
from .margins import LoopsAlone

ROTATIONS = np.linspace(3.0, 9.0, 4)
"""Rotation frequencies [Hz] of a disc with the largest deviation."""
ENVELOPE_FREQUENCIES = np.geomspace(1.0, 500.0, 27)
"""Frequencies [Hz] at which the disc follows the Red Book's envelope, including its lower corner.
"""
DEFECTS = 6
"""Number of equal defects in sequence in a simulation."""


@dataclass(frozen=True, eq=False)
class SwitchedDrives:
    """An axis whose loops switch from its controller to another while a defect passes.

    Parameters
    ----------
    axis
        Focus or radial.
    lower
        Controller K' of strategy "lower".
    defect_length
        Length of the longest defect [m].
    delay
        Delay of the computer [samples].
    displacement
        Largest false displacement that a defect causes, in acceptable errors.
    gain
        Variant of the drives' loop gains.
    """

    axis: Axis
    lower: StateSpace
    defect_length: float
    delay: float
    displacement: float
    gain: Gain

    @cached_property
    def longest(self) -> int:
        """Length of the longest defect [samples]."""
        return max(1, math.ceil(self.defect_length / VELOCITY * RATE))

    @cached_property
    def reference(self) -> StateSpace:
        import control

        return control.ss(controller(self.axis))

    @cached_property
    def alone(self) -> LoopsAlone:
        """Loops with one controller each, for the twelve drives and the nominal one."""
        systems = plants(self.axis, self.gain, "printed")
        return LoopsAlone(
            self.axis, self.reference, self.lower, systems, self.delay, self.defect_length
        )

    @cached_property
    def lenses(self) -> list[SampledPlant]:
        """Lens models of the twelve drives."""
        twelve = drives(self.axis)
        optical = [drive.K_optn for drive in twelve]
        gains = total_gains(self.axis, twelve, optical, self.gain)
        return [
            lens_model(drive, float(K), K_optn, self.delay)
            for drive, K, K_optn in zip(twelve, gains, optical, strict=True)
        ]

    def loops(self, strategy: Any) -> list[SwitchedLoop]:
        """Switched loops of the twelve drives with a strategy."""
        modes = regulators(self.reference, strategy, self.lower)
        return [switched_loop(lens, modes) for lens in self.lenses]

    def program(self, loops: list[SwitchedLoop]) -> SwitchedStability:
        """The search for the least stay in clean parts for which defects up to the longest keep
        stability.
        """
        clean, defect = (
            np.stack([getattr(loop, mode)[0] for loop in loops]) for mode in ("clean", "defect")
        )
        return SwitchedStability(
            (
                Mode("clean", clean, shortest_samples=None),
                Mode("defect", defect, shortest_samples=1, longest_samples=self.longest),
            )
        )

    def disc(self, case: str) -> tuple[RealArray, RealArray]:
        """Amplitudes [um] of the disc and their angular frequencies [rad/s].

        `case` is "rotation" or "envelope".
        """
        harmonics = np.union1d(ENVELOPE_FREQUENCIES, corners(self.axis)[0])
        frequency = ROTATIONS if case == "rotation" else harmonics
        return envelope(self.axis, frequency) / MICRO, 2 * np.pi * frequency

    @property
    def false(self) -> float:
        """Largest false displacement [um]."""
        return self.displacement * ACCEPTABLE_ERROR[self.axis] / MICRO

    def deviations(self, loop: SwitchedLoop, case: str) -> Deviations:
        """The errors of a loop with the disc of a case."""
        return Deviations(loop, *self.disc(case), self.longest, self.false)

    def box(self, share: float) -> SwitchedBox:
        """The parametric set, extended by `share`, with the loops that switch to K'."""
        return parametric_box(self.axis, regulators(self.reference, "lower", self.lower), share)
