"""Each loop of the switched one alone: margins, decay and robust stability (figure 8.10).

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.mu import conditions
from workbench.simulation import sampled
from workbench.synthesis import discretised
from workbench.uncertainty import GeneralisedPlant

from ...control.loops import Margins, loop_response, margins
from ...control.trade_off import CHANNELS, TradeOff
from ...diagnosis.stand_in import low_pass
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD
from ..switched_loop import closed

CONTROLLERS = ("K", "K (1 - F)", "K'")
SAMPLINGS = ("continuous", "sampled", "delayed")
"""Sampled at 35 kHz, and with the delay beside it."""
PADE = 3
"""Order of the rational delay, whose phase is exact to 1e-6 rad up to 2 kHz."""
MU = 1e-2
"""Relative width of the intervals of mu."""
LOW, HIGH, POINTS = 1.0, 17.4e3, 250
PARASITIC = (400.0, 1100.0)
"""Frequencies [Hz] about the parasitic resonances, shown closely."""


@dataclass(frozen=True, eq=False)
class LoopsAlone:
    """Loops of K, K (1 - F) and K' with plants u -> f_en by name, "nominal" one of them.

    delay: of the computer [samples]. length: of the longest defect [m].
    """

    axis: Axis
    K: StateSpace
    lower: StateSpace
    plants: Mapping[str, StateSpace]
    delay: float
    length: float

    @property
    def controllers(self) -> dict[str, StateSpace]:
        """By the names of CONTROLLERS."""
        return dict(zip(CONTROLLERS, (self.K, self.K * low_pass(), self.lower), strict=True))

    def open_loop(self, K: StateSpace, G: StateSpace, sampling: str) -> StateSpace:
        if sampling == "continuous":
            return G * K
        delay = self.delay if sampling == "delayed" else 0.0
        return sampled(G, PERIOD, delay) * discretised(K, PERIOD)

    def growth(self, K: StateSpace, G: StateSpace, sampling: str) -> float:
        """Rate [1/s] of the slowest decaying motion of the closed loop."""
        if sampling == "continuous":
            L = G * K
            return float(np.linalg.eigvals(L.A - L.B @ L.C).real.max())
        A = closed(G, discretised(K, PERIOD), self.delay if sampling == "delayed" else 0.0)
        return math.log(abs(np.linalg.eigvals(A)).max()) / PERIOD

    def margins(self) -> dict[str, Any]:
        """Variables of a dataset: margins and decay of every loop, L of the nominal ones."""
        frequency = np.union1d(np.geomspace(LOW, HIGH, POINTS), np.geomspace(*PARASITIC, POINTS))
        shape = (len(CONTROLLERS), len(SAMPLINGS), len(self.plants))
        gains, phases, growths = (np.full(shape, np.nan) for _ in range(3))
        curves = np.zeros((len(CONTROLLERS), len(frequency)), complex)
        for i, K in enumerate(self.controllers.values()):
            for j, sampling in enumerate(SAMPLINGS):
                for k, G in enumerate(self.plants.values()):
                    growths[i, j, k] = self.growth(K, G, sampling)
                    if growths[i, j, k] < 0.0:
                        found: Margins = margins(self.open_loop(K, G, sampling))
                        gains[i, j, k], phases[i, j, k] = found.gain_db, found.phase
            nominal = self.open_loop(K, self.plants["nominal"], "sampled")
            curves[i] = loop_response(nominal, frequency)
        dims = ("controller", "sampling", "plant")
        text = "of the loops that are stable"
        return {
            "gain_margin": (dims, gains, {"units": "dB", "long_name": f"gain margin {text}"}),
            "phase_margin": (dims, phases, {"units": "deg", "long_name": f"phase margin {text}"}),
            "growth": (dims, growths, {"units": "1/s", "long_name": "rate of the slowest motion"}),
            "L_real": (("controller", "frequency"), curves.real, {"units": "1"}),
            "L_imag": (("controller", "frequency"), curves.imag, {"units": "1"}),
            "frequency": ("frequency", frequency, {"units": "Hz"}),
            "controller": list(CONTROLLERS),
            "sampling": list(SAMPLINGS),
            "plant": list(self.plants),
        }

    def robust(self, context: Context) -> dict[str, Any]:
        """Certified mu of robust stability of each loop, without delay and with all of it.

        That of the hold, half a sample, and of the computer, as a rational approximation.
        """
        import control

        uncertain = TradeOff(self.axis, self.length).uncertain.channel(CHANNELS[:1], "w")
        late = control.ss(control.tf(*control.pade((0.5 + self.delay) * PERIOD, PADE)))
        found = [
            [_mu(uncertain, K), _mu(uncertain, late * K)]
            for K in context.track(list(self.controllers.values()), "robust stability")
        ]
        about = {"units": "1", "long_name": "mixed mu of robust stability, parametric set"}
        return {
            "mu": (("controller", "late", "limit"), found, about),
            "late": ["none", "delay"],
            "limit": ["lower", "upper"],
        }


def _mu(uncertain: GeneralisedPlant, K: StateSpace) -> tuple[float, float]:
    """Bounds of the peak; infinite where the nominal loop is unstable already."""
    peak = conditions(uncertain, K, tolerance=MU).robust_stability
    return (math.inf, math.inf) if peak is None else (peak.lower, peak.upper)
