"""Rotation and data rate of a CD, and the loop that measures its tracking error.

Section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003); the numbers of the disc are those of Standard ECMA-130.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench.types import RealArray

from .actuator import checked_frequency
from .disc import VELOCITY
from .tables import compact_disc

TRACKING_BAND = (500.0, 10e3)
"""Frequencies [Hz] between which the tracking error is measured (Table 2.4)."""


def rotations() -> dict[str, float]:
    """Rotation frequency [Hz] at three places of a disc, with a scanning velocity of 1.3 m/s
    (section 2.5.3).
    """
    disc = compact_disc()
    radii = {
        "lead_in": disc.lead_in_radius,
        "start": disc.program_start,
        "end": disc.program_end,
    }
    return {place: VELOCITY / (2 * math.pi * radius) for place, radius in radii.items()}


def coded_bits_per_mm() -> dict[str, float]:
    """Bits per millimetre of track, with those of the error code, for a slow and a fast disc."""
    disc = compact_disc()
    rate = 8 * disc.frame_coded_bytes * disc.frame_rate
    velocities = {"slow": disc.velocity_min, "fast": disc.velocity_max}
    return {name: 1e-3 * rate / velocity for name, velocity in velocities.items()}


def user_data_rate() -> float:
    """User data [1024 bytes / s] at normal speed (section 2.5.3)."""
    disc = compact_disc()
    return disc.frame_rate / disc.sector_frames * disc.sector_bytes / 1024


def tracking_sensitivity(frequency: ArrayLike) -> RealArray:
    """|S| at frequencies [Hz] (F,) of the loop that measures the tracking error (Table 2.4): (F,).

    The loop is a double integrator with a lead network. S maps the deviation of a track to the
    tracking error.
    """
    disc = compact_disc()

    def shape(f: RealArray) -> RealArray:
        lead = (1 + 1j * f / disc.tracking_lead_zero) / (1 + 1j * f / disc.tracking_lead_pole)
        return np.asarray(-lead / f**2)

    at_crossover = abs(shape(np.array([disc.tracking_crossover])))
    sensitivity: RealArray = 1 / abs(1 + shape(checked_frequency(frequency)) / at_crossover)
    return sensitivity


def largest_tracking_sensitivity() -> float:
    """Largest |S| in the band in which the tracking error is measured."""
    return float(tracking_sensitivity(np.geomspace(*TRACKING_BAND, 1000)).max())
