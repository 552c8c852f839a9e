"""Each single loop of the switched one: margins, decay and robust stability (figure 8.10).

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.executor import Context
from workbench.synthesis import SingleLoops, discretise
from workbench.systems import loop_response
from workbench.types import ComplexArray, RealArray, StateSpace

from ...control.trade_off import CHANNELS, TradeOff
from ...diagnosis.stand_in import low_pass
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD

CONTROLLERS = ("K", "K (1 - F)", "K'")
"""Controllers of the loops: the reference controller, that of strategy C, and K' by mu synthesis.
"""
FREQUENCY = np.union1d(np.geomspace(1.0, 17.4e3, 250), np.geomspace(400.0, 1100.0, 250))
"""Frequencies [Hz] at which L is shown, closely spaced about the parasitic resonances."""


@dataclass(frozen=True, eq=False)
class LoopsAlone:
    """Loops of K, K (1 - F) and K' with plants u -> f_en by name, including "nominal".

    delay: of the computer [samples]. length: of the longest defect [m].
    """

    axis: Axis
    K: StateSpace
    lower: StateSpace
    plants: Mapping[str, StateSpace]
    delay: float
    length: float

    @cached_property
    def loops(self) -> SingleLoops:
        """Loops of the controllers named in CONTROLLERS."""
        controllers = (self.K, self.K * low_pass(), self.lower)
        named = dict(zip(CONTROLLERS, controllers, strict=True))
        discrete = {name: discretise(K, PERIOD) for name, K in named.items()}
        return SingleLoops(named, discrete, self.plants, self.delay)

    def nominal(self, frequency: RealArray) -> ComplexArray:
        """Responses (CONTROLLERS, F) of the nominal loops, sampled without delay."""
        systems = [self.loops.open_loop(name, "nominal", "sampled") for name in CONTROLLERS]
        return np.array([loop_response(L, frequency) for L in systems])

    def robust(self, context: Context) -> RealArray:
        """Certified mu of robust stability, see `SingleLoops.robust`."""
        uncertain = TradeOff(self.axis, self.length).uncertain.channel(
            performance=CHANNELS[:1], exogenous="w"
        )
        return self.loops.robust(uncertain, context)
