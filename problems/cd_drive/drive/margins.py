"""Gain and phase margins of single loops, in the units of the thesis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from workbench.mu import loop_margins
from workbench.types import StateSpace


@dataclass(frozen=True)
class NearestMargins:
    """Changes of the loop that a stable loop tolerates, and the frequencies at its limits.

    decrease, increase        factors on the loop's gain at which it becomes unstable: the nearest
                              below and above 1; 0 and infinity where there is none;
    decrease_hz, increase_hz  frequencies [Hz] at which the loop then oscillates; NaN without one;
    phase                     smallest phase margin [deg] over all crossovers; infinite
                              without a crossover;
    crossover_hz              frequency [Hz] of that crossover, where |L| = 1; NaN without one.
    """

    decrease: float
    increase: float
    decrease_hz: float
    increase_hz: float
    phase: float
    crossover_hz: float

    @property
    def gain_db(self) -> float:
        """Gain margin [dB]: the smaller of the two changes, up and down."""
        down = math.inf if self.decrease == 0 else -math.log10(self.decrease)
        return 20 * min(math.log10(self.increase), down)


MARGIN_UNITS = {
    "decrease": "1",
    "increase": "1",
    "decrease_hz": "Hz",
    "increase_hz": "Hz",
    "phase": "deg",
    "crossover_hz": "Hz",
}
"""Fields of NearestMargins, with the unit of each."""


def nearest_margins(loop: StateSpace) -> NearestMargins:
    """The nearest margins of a stable loop that is closed with negative feedback."""
    found = loop_margins(loop)
    low, high = found.gain
    factors, at = found.gains.T
    phases, crossovers = found.phases_deg.T
    nearest = int(np.argmin(np.abs(phases))) if phases.size else None

    def hz(factor: float) -> float:
        place = np.flatnonzero(factors == factor)
        return float(at[place[0]]) / (2 * math.pi) if place.size else math.nan

    return NearestMargins(
        low,
        high,
        hz(low),
        hz(high),
        math.inf if nearest is None else float(phases[nearest]),
        math.nan if nearest is None else float(crossovers[nearest]) / (2 * math.pi),
    )


def each_margin(rows: Iterable[Iterable[StateSpace]]) -> dict[str, list[list[float]]]:
    """Margins of loops in rows: for each name of MARGIN_UNITS a list of rows of values."""
    found = [[nearest_margins(loop) for loop in row] for row in rows]
    return {name: [[getattr(one, name) for one in row] for row in found] for name in MARGIN_UNITS}
