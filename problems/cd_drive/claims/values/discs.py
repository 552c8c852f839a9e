"""Discs, their beam and the Red Book (chapter 2)."""

from __future__ import annotations

import math

import numpy as np

from workbench import Run

from ...drive.photo_diodes import TRACK_PITCH
from ...drive.tables import Axis, red_book
from .registry import value

DEBRIS = 300e-6


"""Diameter [m] that represents "a few hundred micrometres"."""


@value
def blocked_by_debris(run: Run) -> float:
    """Share of the light of a CD's beam that a particle of size DEBRIS blocks."""
    return (DEBRIS / run.metrics["D_CD_m"]) ** 2


@value
def angle(run: Run, quantity: str, disc: str) -> float:
    """An angle [deg] of Table 2.2, where whole degrees are printed."""
    return float(run.data["beam"].sel(format=disc, quantity=quantity))


@value
def limit(run: Run, axis: Axis, array: str) -> float:
    """A limit of Table 2.3 or 2.4: a maximum of an array over frequency."""
    return float(run.data[array].sel(axis=axis).max())


@value
def attenuation(run: Run, axis: Axis) -> float:
    """Largest deviation over the acceptable error."""
    return float(10 ** (run.metrics[f"attenuation_{axis}_db"] / 20))


@value
def slope(run: Run, axis: Axis, low: float, high: float) -> float:
    """Slope of the envelope between two frequencies [Hz]."""
    envelope = run.data["envelope"].sel(axis=axis)
    logarithms = np.interp(np.log([low, high]), np.log(envelope["frequency"]), np.log(envelope))
    return float(20.0 * math.log10(math.e) * np.diff(logarithms)[0] / np.log10(high / low))


@value
def disc_limit(run: Run) -> float:
    """Deviation [um] of the track that the measuring loop reduces to 0.03 um at most."""
    return 1e6 * red_book("radial").deviation_above / run.metrics["largest_tracking_S"]


@value
def over_least_capacity(run: Run, capacity: float) -> float:
    """A capacity [GB] over that of the smallest CD."""
    return capacity / float(run.data["capacity"].sel(format="CD", bound="least"))


@value
def layer_thickness(run: Run, disc: str) -> float:
    """Cover layer [m] of a format."""
    return float(run.data["layer_thickness"].sel(format=disc))


@value
def tracks_passed(run: Run) -> float:
    """Number of tracks by which an eccentric disc moves in half a revolution."""
    return float(2 * run.data["envelope"].sel(axis="radial").max() / TRACK_PITCH)


@value
def below_line(run: Run) -> float:
    """Rotation at the middle radius, over that on a straight line between the ends."""
    start, end = run.metrics["rotation_start_hz"], run.metrics["rotation_end_hz"]
    return 4.0 * start * end / (start + end) ** 2
