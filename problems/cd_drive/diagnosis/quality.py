"""Surface defects as the diodes show them: the quality signal, and the binary detector.

The quality signal is that of eq. 7.13-7.14, a credibility between 0 and 1. The binary detector,
which every player has, reports a defect or none (section 7.1.2). Equation and section numbers refer
to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench.diagnosis import drop_detector, quality_signal
from workbench.simulation import Controller, kernel
from workbench.types import RealArray

from ..laboratory.experiment import MEASUREMENTS

DIODES = (MEASUREMENTS.index("d1"), MEASUREMENTS.index("d2"))
Quality = Literal["graded", "binary", "prompt"]
"""Signal that opens an estimator: the quality of eq. 7.13; 1 or 0 by the binary detector; 0 exactly
where light is missing, and 1 elsewhere.
"""
DARK = 0.02
"""Share of the clean disc's light below which no error can be read from the diodes."""


def diode_quality(
    level: float, dist_min: float, dist_max: float, alpha: float = 1.0, noise: float | None = None
) -> Controller:
    """Quality, distance from the linear area and normalised error, from the laboratory's signals.

    level: sum of both diodes on a clean disc [V]; the others as in `quality_signal`.
    """
    return quality_signal(
        level, dist_min, dist_max, alpha=alpha, noise=noise, signals=DIODES, extinct=DARK
    )


def dimming_detector(
    level: float, below: float = 0.7, release: float = 0.8, noise: float | None = None
) -> Controller:
    """Alarm (0 or 1) while the sum signal of the laboratory is dimmed; see `drop_detector`.

    level: sum of both diodes on a clean disc [V].
    """
    return drop_detector(
        level, below=below, release=release, noise=noise, signal=MEASUREMENTS.index("sum")
    )


def no_alarm() -> Controller:
    """Part that reads an alarm a, 0 or 1, and gives 1 - a."""
    return Controller(_no_alarm, np.zeros(0), np.zeros(0), reads=1)


@kernel
def _no_alarm(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `no_alarm`."""
    told[0] = 1.0 - given[0]
