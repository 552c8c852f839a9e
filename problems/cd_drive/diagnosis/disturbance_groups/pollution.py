"""Self-pollution: forces on the lens that the drive itself causes (section 2.5.1).

The thesis names an abrupt movement of the sledge, couplings from the other loops, and the air that
the spinning disc moves, but prints no sizes. Section and equation numbers refer to E. Vidal
Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from workbench.errors import InputError
from workbench.types import RealArray

from ...drive.tables import AXES, ActuatorParameters, Axis, red_book
from ...laboratory.bench_setup import find_drive

AUDIO_ROTATION = 9.0
"""Highest rotation frequency [Hz] of an audio CD (section 2.5.1)."""


@dataclass(frozen=True)
class SelfPollution:
    """Forces on the lens of one axis.

    jump       distance [m] that the carriage under the lens moves abruptly;
    jump_start, jump_time  when it begins to move and how long it takes [s];
    coupled    share of the other coil's force that acts on this axis;
    air        amplitude [N] of the air's force at AUDIO_ROTATION; it grows with the square of the
               rotation, as the dynamic pressure does;
    phase      of the air's force at the time 0 [revolutions].

    Raises InputError for a jump that takes no time.
    """

    jump: float = 0.0
    jump_start: float = 0.0
    jump_time: float = 2e-3
    coupled: float = 0.0
    air: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not self.jump_time > 0.0:
            raise InputError(f"{self}: jump_time must be positive")

    @classmethod
    def drawn(cls, rng: np.random.Generator, axis: Axis, start: float) -> Self:
        """Forces with random sizes up to SIZES, with a jump within 10 ms after a start [s]."""
        size = SIZES[axis]
        return cls(
            jump=rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.0) * size.jump,
            jump_start=start + rng.uniform(0.0, 10e-3),
            jump_time=rng.uniform(1e-3, 4e-3),
            coupled=rng.uniform(-1.0, 1.0) * size.coupled,
            air=rng.uniform(0.5, 1.0) * size.air,
            phase=rng.uniform(),
        )

    def force(
        self, axis: Axis, drive: ActuatorParameters, time: RealArray, rotation: float
    ) -> RealArray:
        """w_sp [N] (N,) on a drive's lens at times [s] (N,), with a disc at a rotation [Hz].

        The carriage pulls the lens through the suspension with k z + b z', where its jump z is a
        smooth step. The other coil follows the Red Book's largest deviation on a nominal drive.
        """
        share = np.clip((time - self.jump_start) / self.jump_time, 0.0, 1.0)
        z = self.jump * share**2 * (3.0 - 2.0 * share)
        speed = self.jump / self.jump_time * 6.0 * share * (1.0 - share)
        k = drive.k1 * drive.k2 / (drive.k1 + drive.k2)
        omega = 2 * np.pi * rotation
        other = find_drive(_other(axis), "nominal")
        mass = other.m1 + other.m2
        stiffness = other.k - mass * omega**2 + 1j * omega * other.b
        follows = stiffness * red_book(_other(axis)).deviation * np.exp(1j * omega * time)
        air = self.air * (rotation / AUDIO_ROTATION) ** 2
        blown = air * np.sin(omega * time + 2 * np.pi * self.phase)
        force: RealArray = (
            k * z + (drive.b1 + drive.b2) * speed + self.coupled * follows.imag + blown
        )
        return force


def _other(axis: Axis) -> Axis:
    return AXES[1 - AXES.index(axis)]


SIZES: dict[Axis, SelfPollution] = {
    "focus": SelfPollution(jump=2e-6, coupled=0.02, air=0.05e-3),
    "radial": SelfPollution(jump=5e-6, coupled=0.02, air=0.01e-3),
}
"""Largest sizes that are drawn. They are assumed: a jump of the sledge by three tracks, part of
which reaches the focus; a fiftieth of the other coil's force; and air with a thousandth of the
springs' force at the Red Book's deviation. With them the errors stay in the linear range, as
equation 2.9 requires.
"""
