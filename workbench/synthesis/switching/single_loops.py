"""Each controller of a switched loop by itself, with each plant: margins, decay, robust stability.

Closed with negative feedback, in continuous time, sampled, and sampled with a delay.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.mu import conditions
from workbench.synthesis.implementation.discretise import discretised
from workbench.synthesis.switching.loops import closed_transition
from workbench.systems.margins import margins
from workbench.systems.sampling import sampled

if TYPE_CHECKING:
    from control import StateSpace

    from workbench.uncertainty import GeneralisedPlant

SAMPLINGS = ("continuous", "sampled", "delayed")
"""Loops that are judged: "sampled" behind a hold, "delayed" with the computer's delay beside it."""
PADE_ORDER = 3
"""Order of the rational delay; its phase is exact to 1e-6 rad up to omega delay = 0.5."""
MU_TOLERANCE = 1e-2
"""Relative width of the intervals of mu."""


class LoopMargins(NamedTuple):
    """Gain margins [dB], phase margins [deg] and growth rates [1/s] of loops.

    Each is (controllers, SAMPLINGS, plants). Margins are NaN where the loop is unstable, that is,
    where the growth rate is not negative.
    """

    gain_db: RealArray
    phase: RealArray
    growth: RealArray


@dataclass(frozen=True, eq=False)
class SingleLoops:
    """Loops of controllers with plants, continuous systems by name.

    period [s]: of the computer. delay: its turn-around [samples].
    """

    controllers: Mapping[str, StateSpace]
    plants: Mapping[str, StateSpace]
    period: float
    delay: float

    def open_loop(self, K: StateSpace, G: StateSpace, sampling: str) -> StateSpace:
        """Loop transfer function G K in one of SAMPLINGS."""
        if sampling == "continuous":
            return G * K
        delay = self.delay if sampling == "delayed" else 0.0
        return sampled(G, self.period, delay) * discretised(K, self.period)

    def growth(self, K: StateSpace, G: StateSpace, sampling: str) -> float:
        """Growth rate [1/s] of the slowest decaying motion of a closed loop; negative if stable."""
        if sampling == "continuous":
            L = G * K
            return float(np.linalg.eigvals(L.A - L.B @ L.C).real.max())
        delay = self.delay if sampling == "delayed" else 0.0
        A = closed_transition(G, discretised(K, self.period), delay)
        return math.log(abs(np.linalg.eigvals(A)).max()) / self.period

    def margins(self) -> LoopMargins:
        """Margins and growth rates of every loop."""
        shape = (len(self.controllers), len(SAMPLINGS), len(self.plants))
        gains, phases, growths = (np.full(shape, np.nan) for _ in range(3))
        for i, K in enumerate(self.controllers.values()):
            for j, sampling in enumerate(SAMPLINGS):
                for k, G in enumerate(self.plants.values()):
                    growths[i, j, k] = self.growth(K, G, sampling)
                    if growths[i, j, k] < 0.0:
                        found = margins(self.open_loop(K, G, sampling))
                        gains[i, j, k], phases[i, j, k] = found.gain_db, found.phase
        return LoopMargins(gains, phases, growths)

    def robust(self, uncertain: GeneralisedPlant, context: Context) -> RealArray:
        """Certified mu of robust stability (controllers, 2, 2): without and with delay; its bounds.

        uncertain: continuous generalised plant that every controller is closed with. The delay is
        that of hold and computer, half a period and `delay`, as a rational approximation. Infinite
        where the nominal loop is unstable.
        """
        import control

        late = control.ss(control.tf(*control.pade((0.5 + self.delay) * self.period, PADE_ORDER)))
        return np.array(
            [
                [_mu(uncertain, K), _mu(uncertain, late * K)]
                for K in context.track(list(self.controllers.values()), "robust stability")
            ]
        )


def _mu(uncertain: GeneralisedPlant, K: StateSpace) -> tuple[float, float]:
    """Bounds of the peak; infinite where the nominal loop is unstable already."""
    peak = conditions(uncertain, K, tolerance=MU_TOLERANCE).robust_stability
    return (math.inf, math.inf) if peak is None else (peak.lower, peak.upper)
