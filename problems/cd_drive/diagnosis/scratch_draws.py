"""The random parts of an experiment with a scratch: its angle, its shape, the noise."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from ..drive.tables import Axis

ANGLES: dict[Axis, tuple[float, float]] = {"focus": (0.0, 0.5), "radial": (0.2, 0.36)}
"""Range of angles [revolutions] from which a scratch is drawn, or half a turn later: all angles in
focus; radially those at which the reference controller keeps the track on the worst disc.
"""
EDGES = (0.05, 0.4)
"""Range of the shares of a scratch over which it begins."""


class ScratchDraw(NamedTuple):
    """A scratch, and the seed of the noise in the experiment with it.

    angle [revolutions] at which it starts; sign of its false displacement; edge as in `Defect`.
    """

    seed: int
    angle: float
    sign: float = 1.0
    edge: float = 0.2

    @classmethod
    def drawn(cls, axis: Axis, seed: int) -> Self:
        """The scratch of a seed."""
        rng = np.random.default_rng([seed, 1])
        angle = rng.uniform(*ANGLES[axis]) + rng.choice([0.0, 0.5])
        return cls(seed, angle % 1.0, rng.choice([-1.0, 1.0]), rng.uniform(*EDGES))
