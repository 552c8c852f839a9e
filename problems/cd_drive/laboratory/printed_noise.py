"""Possible readings of the thesis' "noise with an amplitude of 0.15 um" (section 7.3, equation
7.31).

The text does not say whether the amplitude is an rms value or a largest value, nor whether a drive
with little light has the same noise in metres or in volts. The laboratory's default reading is 0.15
um rms, in metres on every drive.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..drive.tables import Axis, drives
from .bench_setup import NOISE, find_drive

Amplitude = Literal["rms", "uniform", "peak"]
"""Meaning of the amplitude: the rms value, the end of a uniform distribution, or three times the
rms value.
"""
Fixed = Literal["metres", "volts"]
"""Quantity whose noise is equal on all drives: the measured position, or the diodes' voltage."""
RMS_OVER_AMPLITUDE: dict[Amplitude, float] = {"rms": 1.0, "uniform": 3**-0.5, "peak": 1 / 3}


def position_noise(
    axis: Axis, drive: str, amplitude: Amplitude = "rms", fixed: Fixed = "metres"
) -> float:
    """Noise [m rms] of a drive's measured position under a reading of the printed amplitude.

    With "volts" the drive with the median optical gain has the same noise as with "metres", and the
    other drives have the same noise voltage: with less light, the noise in metres is larger.
    """
    size = NOISE[axis] * RMS_OVER_AMPLITUDE[amplitude]
    if fixed == "metres":
        return size
    median = float(np.median([one.K_opt for one in drives(axis)]))
    return size * median / find_drive(axis, drive).K_opt
