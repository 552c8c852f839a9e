"""Arms whose links to the lens differ, and the resonances that the lens then shows (section 4.6.2).

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np
from scipy.signal import find_peaks

from workbench.types import ComplexArray, RealArray

from ...drive.actuator import Actuator
from ...drive.tables import ActuatorParameters
from ..bench_setup import split_arms

HALVES, ARMS = 2, 4
PROMINENCE = 0.5
"""Least height [dB] of a resonance above the dips beside it, if it is to count as shown."""
LEAST_RESIDUE = 1e-6
"""Modes with a residue below this, relative to the largest modal residue, do not move the lens."""
LARGEST_MISMATCH = 0.9
"""Largest mismatch of a random arm; with a larger one it would hardly be linked."""


def random_mismatches(
    rng: np.random.Generator, deviation: float, draws: int, arms: int = ARMS
) -> RealArray:
    """Normally distributed mismatches (draws, arms) with this standard deviation; each row sums to
    0.
    """
    found = deviation * rng.standard_normal((draws, arms))
    found -= found.mean(axis=1, keepdims=True)
    largest = abs(found).max(axis=1, keepdims=True)
    shrunk: RealArray = found * np.minimum(1.0, LARGEST_MISMATCH / largest)
    return shrunk


def resonances_shown(frequency: RealArray, response: ComplexArray) -> int:
    """Number of parasitic resonances that a response x/u (F,) shows.

    These are peaks of the acceleration, that is of |x/u| multiplied by the squared frequency.
    """
    level = 20 * np.log10(abs(response) * frequency**2)
    return len(find_peaks(level, prominence=PROMINENCE)[0])


def order_of(actuator: Actuator) -> int:
    """Order of the model u -> x: number of modes that the coil moves and that move the lens."""
    system = actuator.state_space()
    poles, vectors = np.linalg.eig(system.A)
    left = np.linalg.solve(vectors, system.B)[:, 0]
    residues = abs((system.C @ vectors)[0] * left / poles)
    return int((residues > LEAST_RESIDUE * residues.max()).sum())


def shares_shown(
    rng: np.random.Generator,
    parameters: ActuatorParameters,
    frequency: RealArray,
    deviations: RealArray,
    draws: int,
) -> RealArray:
    """Share of random arms (S, ARMS) that show 1, 2, 3 or 4 resonances, for standard deviations
    (S,).
    """
    found = np.zeros((len(deviations), ARMS))
    for n, deviation in enumerate(deviations):
        for mismatch in random_mismatches(rng, deviation, draws):
            response = split_arms(parameters, mismatch.tolist()).response(frequency)
            shown = min(max(resonances_shown(frequency, response), 1), ARMS)
            found[n, shown - 1] += 1 / draws
    return found
