"""Independent computations that the checks of `cd/playability` compare with.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np

from workbench.systems import modulus_margin
from workbench.types import Dataset

from ...drive.disc import VELOCITY
from ...drive.plants import controller, responses
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import PERIOD, RATE
from ..ensemble import Circumstance
from .runs import Design, evaluated, played


def continuous_peak(axis: Axis, gain_db: float) -> float:
    """Largest |S| of the twelve continuous loops (eq. 3.18, 6.12) with a delay of 1.5 samples."""
    frequency = np.geomspace(20.0, 15e3, 997)
    s = 2j * np.pi * frequency
    K = 10.0 ** (gain_db / 20.0) * controller(axis)(s)
    L = K * responses(axis, frequency) * np.exp(-1.5 * s * PERIOD)
    return 1.0 / modulus_margin(L)


def trace_difference(axis: Axis, own: Dataset) -> float:
    """Largest difference in share out of spec and in burst between a run and its stored trace.

    ``own``: a run's scores, and its trace, which is counted sample by sample.
    """
    longest = run = beyond = 0
    for value in own["trace"].values:
        run = run + 1 if abs(float(value)) > ACCEPTABLE_ERROR[axis] else 0
        longest, beyond = max(longest, run), beyond + (run > 0)
    share = abs(beyond / own.sizes["sample"] - float(own["out"]))
    return max(share, abs(longest * VELOCITY / RATE - float(own["burst"])))


def half_step_change(one: Circumstance, design: Design, duration: float, own: Dataset) -> float:
    """Relative change of a run's rms error when the step of the simulation is halved.

    ``own``: the run's scores. The result is 0 if the track was lost, since such a run is chaotic.
    """
    if float(own["losses"]) > 0.0:
        return 0.0
    error = evaluated(played(one, str(own["drive"].values), design, duration, refine=2))
    return abs(float(np.sqrt(np.mean(error**2))) / float(own["deviation"]) - 1.0)
