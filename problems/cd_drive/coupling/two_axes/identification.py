"""Both axes identified as a system with two inputs and two outputs, in closed loop.

Multisines are added to both commands at once. A second experiment repeats them with the sign of the
radial one changed, so that both inputs can be told apart at every line. Then the responses follow
from the averaged periods (eq. 4.9 to 4.15). Equation numbers refer to E. Vidal Sanchez, Robust and
Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from workbench.identification import periodic_response, random_multisine
from workbench.simulation import sampled_model
from workbench.types import ComplexArray, RealArray

from ...drive.disc import Disc
from ...drive.plants import ANTIALIASING
from ...laboratory.bench_setup import PERIOD
from ..bench import TwoAxisBench
from ..paths import TwoAxes

SAMPLES = 7000
"""Samples in a period of the excitation: lines are multiples of 5 Hz."""
LINES = np.unique(np.round(np.geomspace(150.0, 4000.0, 16) * SAMPLES * PERIOD)).astype(int)
FREQUENCIES: RealArray = LINES / (SAMPLES * PERIOD)
"""Frequencies [Hz] of the excitation (F,)."""
AMPLITUDES = np.array([0.15, 0.02])
"""Amplitudes [V] of a line in both axes; the errors stay in the linear ranges of the diodes."""
PERIODS, DISCARDED = 30, 2
"""Number of periods played, and of those at the start that are left out."""
STILL = Disc(rotation=0.0, run_up=0.0)


class Identified(NamedTuple):
    """Response (F, 2, 2) from the commands to the errors, radius (F, 2, 2) of its 99 % discs, and
    largest true error [m] of each axis (2,) while it was measured.
    """

    response: ComplexArray
    radius: RealArray
    largest: RealArray


def identified(bench: TwoAxisBench, seed: int) -> Identified:
    """One draw of the experiment."""
    phases, noise = np.random.default_rng(seed).spawn(2)
    played = [random_multisine(LINES, one, SAMPLES, phases).period() for one in AMPLITUDES]
    inputs, outputs, largest = [], [], np.zeros(2)
    for sign in (1.0, -1.0):
        excitation = np.tile(np.transpose(played) * [1.0, sign], (PERIODS, 1))
        duration = PERIODS * SAMPLES * PERIOD
        found = bench.closed_loop(STILL, duration, excitation, seed=int(noise.integers(2**31)))
        inputs.append(_amplitudes(found.command / AMPLITUDES))
        outputs.append(_amplitudes(found.read))
        largest = np.maximum(largest, abs(found.error).max(axis=0))
    u, y = (np.stack(one, axis=-1) for one in (inputs, outputs))
    estimate = periodic_response(FREQUENCIES, u, y, transients=DISCARDED)
    radius = estimate.radius(confidence=0.99) / AMPLITUDES
    return Identified(estimate.response / AMPLITUDES, radius, largest)


@cache
def exact(two: TwoAxes) -> ComplexArray:
    """The response (F, 2, 2) in the linear range, with hold, filters and the computer's delay."""
    import control

    gains = np.diag([one.K_optn for one in two.axes])
    lag = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
    model = control.append(lag, lag) * (-gains @ two.optics) * two.actuator
    z = np.exp(2j * np.pi * FREQUENCIES * PERIOD)
    found: ComplexArray = np.moveaxis(sampled_model(model, PERIOD, delay_samples=1.0)(z), -1, 0)
    return found


def shares(response: ComplexArray) -> ComplexArray:
    """Coupling (..., 2) from the other axis over the own response: (..., F, 2, 2) ->
    (..., F, 2).
    """
    own, other = response[..., [0, 1], [0, 1]], response[..., [0, 1], [1, 0]]
    return other / own


def _amplitudes(signal: RealArray) -> ComplexArray:
    """Complex amplitudes (F, periods, 2) of signals (N, 2) at the lines."""
    periods = signal.reshape(PERIODS, SAMPLES, 2)
    found: ComplexArray = np.moveaxis(np.fft.rfft(periods, axis=1)[:, LINES], 0, 1) * 2 / SAMPLES
    return found
