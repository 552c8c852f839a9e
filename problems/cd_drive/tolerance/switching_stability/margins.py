"""Each loop of the switched one alone: margins, decay and robust stability (figure 8.10).

Figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.synthesis import discretised
from workbench.synthesis.switching.single_loops import SAMPLINGS, SingleLoops
from workbench.systems import loop_response

from ...control.trade_off import CHANNELS, TradeOff
from ...diagnosis.stand_in import low_pass
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD

CONTROLLERS = ("K", "K (1 - F)", "K'")
LOW, HIGH, POINTS = 1.0, 17.4e3, 250
"""Frequencies [Hz] at which L is shown."""
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
    def loops(self) -> SingleLoops:
        """By the names of CONTROLLERS."""
        controllers = (self.K, self.K * low_pass(), self.lower)
        named = dict(zip(CONTROLLERS, controllers, strict=True))
        discrete = {name: discretised(K, PERIOD) for name, K in named.items()}
        return SingleLoops(named, discrete, self.plants, self.delay)

    def margins(self) -> dict[str, Any]:
        """Variables of a dataset: margins and decay of every loop, L of the nominal ones."""
        frequency = np.union1d(np.geomspace(LOW, HIGH, POINTS), np.geomspace(*PARASITIC, POINTS))
        loops = self.loops
        found = loops.margins()
        curves = np.zeros((len(CONTROLLERS), len(frequency)), complex)
        for i, name in enumerate(CONTROLLERS):
            nominal = loops.open_loop(name, "nominal", "sampled")
            curves[i] = loop_response(nominal, frequency)
        dims = ("controller", "sampling", "plant")
        text = "of the loops that are stable"
        gain = {"units": "dB", "long_name": f"gain margin {text}"}
        phase = {"units": "deg", "long_name": f"phase margin {text}"}
        return {
            "gain_margin": (dims, found.gain_db, gain),
            "phase_margin": (dims, found.phase, phase),
            "growth": (
                dims,
                found.growth,
                {"units": "1/s", "long_name": "rate of the slowest motion"},
            ),
            "L_real": (("controller", "frequency"), curves.real, {"units": "1"}),
            "L_imag": (("controller", "frequency"), curves.imag, {"units": "1"}),
            "frequency": ("frequency", frequency, {"units": "Hz"}),
            "controller": list(CONTROLLERS),
            "sampling": list(SAMPLINGS),
            "plant": list(self.plants),
        }

    def robust(self, context: Context) -> dict[str, Any]:
        """Certified mu of robust stability of each loop, without delay and with all of it."""
        uncertain = TradeOff(self.axis, self.length).uncertain.channel(CHANNELS[:1], "w")
        about = {"units": "1", "long_name": "mixed mu of robust stability, parametric set"}
        return {
            "mu": (("controller", "late", "limit"), self.loops.robust(uncertain, context), about),
            "late": ["none", "delay"],
            "limit": ["lower", "upper"],
        }
