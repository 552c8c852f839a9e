"""The uncertain loop at five times the nominal speed, at frequencies and as functions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from workbench.fitting import Rational
from workbench.synthesis import LoopFunctions, LoopWeights
from workbench.types import RealArray
from workbench.uncertainty import UncertaintyModel

from ...drive.tables import Axis
from ..control_problem import control_gain, optical_gain, performance_function
from ..loop_weights import NONE, loop_weights

SPEED = 5.0
"""Speed of the disc, in multiples of the nominal one."""


@dataclass(frozen=True, eq=False)
class UncertainLoop:
    """An axis and its uncertain plant, at the speed of the study."""

    axis: Axis
    model: UncertaintyModel

    speed: ClassVar[float] = SPEED

    def weights(self, omega: RealArray, channel: str = "both", speed: float = SPEED) -> LoopWeights:
        """Weights that determine mu of a channel, at frequencies (F,) [rad/s].

        `channel` is "disturbance" or "both".
        """
        found = loop_weights(self.axis, self.model, speed, omega)
        return found if channel == "both" else replace(found, control=np.zeros(omega.shape))

    @property
    def loops(self) -> Mapping[str, LoopFunctions]:
        """The loop without uncertainty and with it, as functions for proofs."""
        gain = optical_gain(self.axis)
        whole = LoopFunctions(
            performance_function(self.axis, self.speed),
            Rational(NONE, NONE, control_gain(self.axis)),
            self.model.nominal.scaled(1 / gain),
            circular=self.model.W_c,
            real=self.model.W_r,
        )
        return {"nominal": whole.nominal, "dynamic": whole}
