"""The uncertain loop at five times the nominal speed, and the T that a level of mu allows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from workbench.arrays import RealArray
from workbench.synthesis import LoopWeights, SetsAt, allowed_discs, allowed_polygons
from workbench.uncertainty import UncertaintyModel

from ...drive.tables import Axis
from ..loop_weights import loop_weights

SPEED = 5.0
"""Speed of the disc, in multiples of the nominal one."""


@dataclass(frozen=True, eq=False)
class UncertainLoop:
    """An axis and its uncertain plant, at the speed of the study."""

    axis: Axis
    model: UncertaintyModel

    speed: ClassVar[float] = SPEED

    def weights(self, omega: RealArray, channel: str = "both", speed: float = SPEED) -> LoopWeights:
        """Weights that mu of a channel depends on, at frequencies (F,) [rad/s].

        `channel` is "disturbance" or "both".
        """
        found = loop_weights(self.axis, self.model, speed, omega)
        return found if channel == "both" else replace(found, control=np.zeros(omega.shape))

    @property
    def sets(self) -> Mapping[str, SetsAt]:
        """The T that a level of mu allows: of nominal loops, and of those with uncertainty."""
        return {
            "nominal": lambda omega, level: allowed_discs(self.weights(omega), level),
            "dynamic": lambda omega, level: allowed_polygons(self.weights(omega), level),
        }
