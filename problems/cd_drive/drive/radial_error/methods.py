"""Four methods that sense a track, from the light that the track's pits diffract (section 2.4.4).

Every track of the layer is a row of equal pits, which together are half as long as the track. Spot,
pits and pupil are those of `workbench.optics.layers`. Section numbers refer to E. Vidal Sanchez,
Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from workbench.optics import Pupil, Reading, TrackLayer, quadrants, read_layer, round_pupil
from workbench.types import RealArray

from ..disc import VELOCITY
from ..tables import compact_disc, disc_formats

TWIN, PUSH_PULL, WOBBLE, DPD = METHODS = ("twin spot", "push-pull", "track wobble", "DPD")
"""The methods of section 2.4.4; DPD is differential phase detection."""
PIT_DEPTH = 0.12e-6
"""Depth of a pit [m] (section 2.4)."""
CHANNEL_BITS = 588
"""Channel bits in a frame (Standard ECMA-130, section 19)."""
WOBBLED = 30e-9
"""Amplitude of the wobble [m], "few decades of nanometres"."""
CELLS = 64
"""Number of cells along the diameter of the pupil."""


def bit_length() -> float:
    """Length of a channel bit on the track [m] at 1.3 m/s."""
    return VELOCITY / (CHANNEL_BITS * compact_disc().frame_rate)


def printed_depth() -> float:
    """Depth of a pit as the thesis prints it, in wavelengths in the disc."""
    disc = disc_formats()["CD"]
    return PIT_DEPTH * disc.refractive_index / disc.wavelength


@dataclass(frozen=True, eq=False)
class TrackSensor:
    """The optics of a CD over a layer of pits.

    depth: depth of the pits in wavelengths in the disc; reflected light is delayed by twice as
    much. width: width of a pit [m]. bits: length of a pit, and of the land behind it, in channel
    bits. stagger: shift of the pits from track to track, over their period. reflection: amplitude
    that a pit reflects, over that of the land. landing: displacement of the light on the split
    diodes across the tracks, in radii of the pupil. focus_error: distance of the layer from the
    focus [m].
    """

    depth: float
    width: float
    bits: int
    stagger: float = 0.0
    reflection: float = 1.0
    landing: float = 0.0
    focus_error: float = 0.0

    def layer(self) -> TrackLayer:
        """The layer, with lengths in units of wavelength / NA."""
        disc = disc_formats()["CD"]
        pit = self.bits * bit_length() / _unit()
        return TrackLayer(
            pitch=disc.track_pitch / _unit(),
            period=2 * pit,
            length=pit,
            width=self.width / _unit(),
            phase=4 * np.pi * self.depth,
            reflection=self.reflection,
            stagger=self.stagger,
        )

    def reading(self, place: RealArray) -> Reading:
        """Light on the four quadrants at distances (Y,) [m] from the middle of a track."""
        pupil = _pupil()
        detectors = quadrants(pupil, shift=self.landing)
        late = self._defocus if self.focus_error else None
        return read_layer(self.layer(), pupil, place / _unit(), detectors, aberration=late)

    def _defocus(self, radius: RealArray) -> RealArray:
        """Path [wavelengths] by which the light at a distance from the pupil's centre is late."""
        disc = disc_formats()["CD"]
        path: RealArray = 1.0 - np.sqrt(1.0 - (disc.NA * radius) ** 2)
        return self.focus_error / disc.wavelength * path

    def light(self, place: RealArray) -> RealArray:
        """Light (Y,) on all quadrants together, over that of a mirror, averaged along the track."""
        light: RealArray = self.reading(place).mean.sum(axis=1)
        return light

    def errors(self, place: RealArray) -> dict[str, RealArray]:
        """Normalised radial error of every method (Y,) at distances [m] from a track.

        Twin spot and push-pull: difference over sum of averages. Wobble: difference over sum of the
        carrier's envelope at both ends of the wobble. DPD: phase between the carriers of the two
        diagonals [rad].
        """
        pitch = disc_formats()["CD"].track_pitch
        side, other = (self.light(place + sign * pitch / 4) for sign in (1, -1))
        ends = [abs(self.reading(place + s * WOBBLED).carrier.sum(axis=1)) for s in (-1, 1)]
        mean, carrier = self.reading(place)
        halves = mean[:, 2:].sum(axis=1), mean[:, :2].sum(axis=1)
        diagonals = carrier[:, ::2].sum(axis=1), carrier[:, 1::2].sum(axis=1)
        return {
            TWIN: _contrast(side, other),
            PUSH_PULL: _contrast(*halves),
            WOBBLE: _contrast(ends[0], ends[1]),
            DPD: np.angle(diagonals[0] * diagonals[1].conj()),
        }

    def strengths(self) -> dict[str, float]:
        """Largest differences of light before normalising, over a mirror's light.

        Twin spot: difference of the side spots. Push-pull: difference of the halves. Wobble and
        DPD: amplitude of the carrier on the track, from which both are read.
        """
        pitch = disc_formats()["CD"].track_pitch
        ends = self.light(np.array([0.0, 0.5]) * pitch)
        quarter = self.reading(np.array([0.25]) * pitch).mean[0]
        carrier = float(2 * abs(self.reading(np.zeros(1)).carrier.sum()))
        return {
            TWIN: float(abs(ends[1] - ends[0])),
            PUSH_PULL: float(abs(quarter[:2].sum() - quarter[2:].sum())),
            WOBBLE: carrier,
            DPD: carrier,
        }


def _unit() -> float:
    disc = disc_formats()["CD"]
    return disc.wavelength / disc.NA


@cache
def _pupil() -> Pupil:
    return round_pupil(CELLS)


def _contrast(one: RealArray, other: RealArray) -> RealArray:
    contrast: RealArray = (one - other) / (one + other)
    return contrast
