"""Quantities of a drive that follow from the tables without an experiment: resonance, coil, sums.

Section and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .actuator import SERIES_RESISTANCE, resonances, specific_model
from .shared_parameters import WINDOWS
from .tables import Drive


@dataclass(frozen=True)
class DerivedQuantity:
    """A quantity that follows from the tables of one drive: its unit, meaning and function."""

    unit: str
    meaning: str
    of: Callable[[Drive], float]


def moving_mass(drive: Drive) -> float:
    """m = m1 + m2 [kg] (eq. 4.18)."""
    return drive.m1 + drive.m2


def electric_damping(drive: Drive) -> float:
    """Damping [N s/m] that the back-EMF causes through the coil's circuit (eq. 4.16)."""
    return drive.Bl**2 / (drive.R + SERIES_RESISTANCE)


def quality_factor(drive: Drive, damping: float) -> float:
    """Quality factor 1 / (2 zeta) of the first resonance with this damping [N s/m]
    (section 3.2.2).
    """
    return math.sqrt(drive.k * moving_mass(drive)) / damping


def decay(drive: Drive) -> float:
    """Rate [1/s] at which the first resonance decays, with the back-EMF (eq. 4.16)."""
    return (drive.b + electric_damping(drive)) / (2.0 * moving_mass(drive))


def peak_frequency(drive: Drive) -> float:
    """Frequency [Hz] at which |x / u| of the lumped model of equation 4.16 is largest."""
    return math.sqrt(drive.k / moving_mass(drive) - 2.0 * decay(drive) ** 2) / (2 * math.pi)


def shown_by_current(drive: Drive, resonance: str) -> float:
    """Range of |v_r / u| within the window of a resonance, relative to its level (eq. 4.17, not
    lumped).
    """
    frequency = np.linspace(*WINDOWS[drive.axis][resonance], 400)
    speed = 2j * np.pi * frequency * specific_model(drive).response(frequency)
    return float(np.ptp(abs(1.0 - drive.Bl * speed)))


DERIVED = {
    "quality": DerivedQuantity(
        "1", "of the first resonance, force to displacement", lambda d: quality_factor(d, d.b)
    ),
    "driven quality": DerivedQuantity(
        "1",
        "the same, voltage to displacement",
        lambda d: quality_factor(d, d.b + electric_damping(d)),
    ),
    "decay": DerivedQuantity("1/s", "of the first resonance", decay),
    "shift by r": DerivedQuantity(
        "Hz",
        "of the first resonance, when r is put in series with the coil",
        lambda d: resonances(d).first - resonances(d, 0.0).first,
    ),
    "shift by Bl": DerivedQuantity(
        "Hz",
        "of the first peak, when Bl is a tenth smaller",
        lambda d: peak_frequency(replace(d, Bl=0.9 * d.Bl)) - peak_frequency(d),
    ),
    "first in current": DerivedQuantity(
        "1", "dip of the coil's current", lambda d: shown_by_current(d, "first resonance")
    ),
    "parasitic in current": DerivedQuantity(
        "1", "ripple of the coil's current", lambda d: shown_by_current(d, "parasitic resonance")
    ),
    "coil pole": DerivedQuantity(
        "Hz", "R_measured / (2 pi L)", lambda d: d.R_measured / (2 * math.pi * d.L)
    ),
    "r over R": DerivedQuantity("1", "series resistor", lambda d: SERIES_RESISTANCE / d.R),
    "R off": DerivedQuantity("1", "R over R_measured, less 1", lambda d: d.R / d.R_measured - 1.0),
    "k off": DerivedQuantity(
        "N/m", "k less k1 and k2 in series", lambda d: d.k - d.k1 * d.k2 / (d.k1 + d.k2)
    ),
    "b off": DerivedQuantity("N s/m", "b less b1 + b2", lambda d: d.b - d.b1 - d.b2),
    "b2 over b": DerivedQuantity("1", "share of the damper", lambda d: d.b2 / d.b),
}
"""Quantities of a drive by name (sections 3.2.2, 3.6.2, 3.7, 4.3.1, 4.6.1)."""
