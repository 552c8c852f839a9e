"""Modulation of HF by pits of one length."""

from __future__ import annotations

import numpy as np

from workbench.types import RealArray

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.radial_error.methods import TrackSensor, printed_depth
from ..bench import PITS

PLACES = ("on a track", "between")
"""Places of the spot: in the middle of a track, and half way to the next."""


def modulation(bits: int, focus_error: float) -> RealArray:
    """Amplitude of the light at the pits' frequency over its mean, at PLACES (2,).

    The pits have this many channel bits. Harmonics are left out; of pits of 3 channel bits the lens
    passes none.
    """
    width, _, stagger = PITS
    sensor = TrackSensor(printed_depth(), width, bits, stagger, focus_error=focus_error)
    mean, carrier = sensor.reading(np.array([0.0, TRACK_PITCH / 2]))
    found: RealArray = 2.0 * abs(carrier.sum(axis=1)) / mean.sum(axis=1)
    return found
