"""Open loops of the twelve drives with the reference controller, their margins and bandwidths.

    L = K G AAF,    closed with negative feedback: S = 1 / (1 + L), T = L / (1 + L)

in continuous time or sampled: the plant behind a zero-order hold, the controller by the bilinear
transform. Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize.elementwise import find_root

from workbench.arrays import ComplexArray, RealArray
from workbench.heavy_types import StateSpace
from workbench.simulation import sampled
from workbench.systems.generalised_plant import response

from ..drive.plants import Gain, controller, nominal_parameters, plant, total_gain, total_gains
from ..drive.tables import Axis, Values, drives
from ..laboratory.bench_setup import PERIOD, RATE

SCALES = {"full": 1.0, "third": 1 / 3}
"""Gains of the controller in figure 6.6, relative to eq. 6.12."""
CROSSING_POINTS = 600
"""Number of frequencies of the grid on which crossings are searched."""
LOWEST, HIGHEST = 1.0, 1e5
"""Ends of that grid [Hz]; in sampled loops it ends at half the sampling frequency."""
NYQUIST = 0.999 * RATE / 2
HALF_POWER = 2**-0.5
"""Magnitude of -3 dB."""

Curve = Callable[[RealArray], Any]


def plants(axis: Axis, gain: Gain, values: Values) -> dict[str, StateSpace]:
    """Equation 3.18 of the twelve drives, and last of the nominal one, by name."""
    twelve = drives(axis, values)
    gains = total_gains(axis, twelve, [drive.K_optn for drive in twelve], gain)
    systems = {drive.name: plant(drive, float(K)) for drive, K in zip(twelve, gains, strict=True)}
    return systems | {"nominal": plant(nominal_parameters(axis), total_gain(axis))}


def open_loop(axis: Axis, system: StateSpace, delay: float | None = None) -> StateSpace:
    """L of a plant; sampled where a delay [samples] beyond the hold's is given, 0 or more."""
    import control

    K = control.ss(controller(axis))
    if delay is None:
        return system * K
    return sampled(system, PERIOD, delay) * control.sample_system(K, PERIOD, "bilinear")


def loop_response(loop: StateSpace, frequency: RealArray) -> ComplexArray:
    """L at `frequency` [Hz] (F,): (F,)."""
    values: ComplexArray = response(loop, 2 * np.pi * frequency)[:, 0, 0]
    return values


def search_grid(loop: StateSpace, lowest: float = LOWEST) -> RealArray:
    """Frequencies [Hz] of a loop among which crossings are looked for."""
    return np.geomspace(lowest, NYQUIST if loop.dt else HIGHEST, CROSSING_POINTS)


def crossings(curve: Curve, frequency: RealArray) -> RealArray:
    """Frequencies [Hz] at which a continuous curve changes its sign, found between neighbours."""
    before = np.flatnonzero(np.diff(np.sign(curve(frequency))))
    ends = np.log(frequency)
    found = find_root(lambda x: curve(np.exp(x)), (ends[before], ends[before + 1]))
    roots: RealArray = np.exp(found.x)
    return roots


def bands(curve: Curve, frequency: RealArray) -> list[tuple[float, float]]:
    """Frequency ranges [Hz] of a grid in which a curve is positive."""
    edges = [frequency[0], *crossings(curve, frequency), frequency[-1]]
    middle = np.sqrt(np.multiply(edges[1:], edges[:-1]))
    inside = curve(middle) > 0
    return [
        (float(low), float(high))
        for low, high, positive in zip(edges[:-1], edges[1:], inside, strict=True)
        if positive
    ]


@dataclass(frozen=True)
class Margins:
    """Gain margins of a loop as factors, and its phase margin [deg].

    ``decrease`` < 1 < ``increase`` are the ends of the stable range about the loop's own gain;
    0 and infinity where there is none. The loop oscillates there at ``decrease_hz`` and
    ``increase_hz``. ``crossover_hz`` is where the phase margin is.
    """

    decrease: float
    increase: float
    decrease_hz: float
    increase_hz: float
    phase: float
    crossover_hz: float

    @property
    def gain_db(self) -> float:
        """Gain margin [dB] as Table A.4 has it: the smaller change, up or down."""
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
"""Fields of Margins, and the unit of each."""


def margins(loop: StateSpace) -> Margins:
    """Margins of a loop that is stable, from where its response crosses the negative real axis.

    By response and not by polynomials: those of a sampled loop with an integrator have no digits.
    """

    def L(frequency: RealArray) -> ComplexArray:
        return loop_response(loop, frequency)

    grid = search_grid(loop)
    at = crossings(lambda f: L(f).imag, grid)
    negative = at[L(at).real < 0] if at.size else at
    limit = -1 / L(negative).real if negative.size else negative
    below, above = np.flatnonzero(limit < 1), np.flatnonzero(limit > 1)
    low = below[np.argmax(limit[below])] if below.size else None
    high = above[np.argmin(limit[above])] if above.size else None
    gains = crossings(lambda f: np.log(abs(L(f))), grid)
    phases = np.degrees(np.angle(-L(gains))) if gains.size else np.array([math.inf])
    nearest = int(np.argmin(abs(phases)))
    return Margins(
        0.0 if low is None else float(limit[low]),
        math.inf if high is None else float(limit[high]),
        math.nan if low is None else float(negative[low]),
        math.nan if high is None else float(negative[high]),
        float(phases[nearest]),
        float(gains[nearest]) if gains.size else math.nan,
    )


def each_margin(rows: Iterable[Iterable[StateSpace]]) -> dict[str, list[list[float]]]:
    """Margins of rows of loops, one array for each name of MARGIN_UNITS."""
    found = [[margins(loop) for loop in row] for row in rows]
    return {name: [[getattr(one, name) for one in row] for row in found] for name in MARGIN_UNITS}


def bandwidths(loop: StateSpace) -> dict[str, float]:
    """Bandwidth [Hz] by definition.

    "S": below it |S| stays under -3 dB; "crossover": above it |L| stays under 1; "T": above it |T|
    stays under -3 dB. NaN where there is no such frequency.
    """

    def L(frequency: RealArray) -> ComplexArray:
        return loop_response(loop, frequency)

    grid = search_grid(loop)
    sensitive = crossings(lambda f: abs(1 / (1 + L(f))) - HALF_POWER, grid)
    unity = crossings(lambda f: np.log(abs(L(f))), grid)
    complementary = crossings(lambda f: abs(L(f) / (1 + L(f))) - HALF_POWER, grid)
    return {
        "S": float(sensitive[0]) if sensitive.size else math.nan,
        "crossover": float(unity[-1]) if unity.size else math.nan,
        "T": float(complementary[-1]) if complementary.size else math.nan,
    }
