"""Two methods that sense the focus, with the light on two pairs of diodes (section 2.4.3).

A disc at the distance e from the focus of an objective with aperture NA sends back the wave exp(i k
2 e (1 - cos theta)); a lens focuses it on the diodes.

Foucault: half of the pupil remains, and two diodes meet at the focus. This is the arrangement of
hologram pickups (figure 3.11). Figure 2.7 puts the knife into the focus and the diodes behind it.
With diodes that catch all the light, both arrangements give the same difference.

Astigmatic: a cylindrical lens adds the wave k e_a NA^2 2 x y, so that focal lines fall on the
diodes at the errors +-e_a, along the diagonals of four quadrants.

Lengths on the diodes are divided by the magnification f_detector / f_objective: they are lengths at
the disc. Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.optics import Pupil, defocus, round_pupil, share_within, spot
from workbench.types import ComplexArray, RealArray

from ..tables import DiscFormat

CELLS = 128
"""Number of cells along the diameter of the pupil."""
CELLS_PER_UNIT = 6
"""Number of detector cells in a length of wavelength / NA."""


@dataclass(frozen=True, eq=False)
class FocusSensor:
    """The optics of one disc format, with the focus errors [m] (E,) at which signals are computed.

    reach: half the width [m] of the largest diode.
    """

    disc: DiscFormat
    errors: RealArray
    reach: float

    @property
    def unit(self) -> float:
        """Length unit wavelength / NA [m]."""
        return self.disc.wavelength / self.disc.NA

    @cached_property
    def pupil(self) -> Pupil:
        return round_pupil(CELLS)

    @cached_property
    def place(self) -> RealArray:
        """Centres of the detector's cells in units of `unit`; 0 lies on a boundary of cells."""
        half = int(np.ceil(self.reach / self.unit * CELLS_PER_UNIT)) + 2
        return (np.arange(2 * half) - half + 0.5) / CELLS_PER_UNIT

    def least_confusion(self, lines: float) -> float:
        """Radius [m] of the round spot in focus, with this distance [m] between the focal lines."""
        return lines * self.disc.NA

    def knife(self) -> RealArray:
        """Spots (E, N, N) of the half pupil of Foucault's method."""
        half = self.pupil.share * (self.pupil.x > 0.0)[:, None]
        return self._spots(half.astype(complex))

    def astigmatic(self, lines: float) -> RealArray:
        """Spots (E, N, N) of the astigmatic method, with this distance [m] between the
        focal lines.
        """
        x = self.pupil.x
        path = lines / 2 * self.disc.NA**2 * 2.0 * np.outer(x, x)
        return self._spots(self.pupil.share * np.exp(1j * self._wave_number * path))

    @property
    def _wave_number(self) -> float:
        return 2 * np.pi / self.disc.wavelength

    def _spots(self, field: ComplexArray) -> RealArray:
        path = 2.0 * self._wave_number * defocus(self.pupil, self.disc.NA)
        return np.array(
            [spot(self.pupil, field * np.exp(1j * e * path), self.place) for e in self.errors]
        )

    def on_halves(self, spots: RealArray, half_width: float, shift: float = 0.0) -> RealArray:
        """Shares of the light (2, E) on two diodes that meet at the line u = shift [m]."""
        low, high, both = self._sides(half_width, shift)
        return np.array([self._light(spots, low, both), self._light(spots, high, both)])

    def on_quadrants(self, spots: RealArray, half_width: float, shift: float = 0.0) -> RealArray:
        """Shares of the light (2, E) on both pairs of opposite quadrants, all shifted by `shift`
        [m] along u.
        """
        low, high, _ = self._sides(half_width, shift)
        left, right, _ = self._sides(half_width, 0.0)
        pairs = (((high, right), (low, left)), ((high, left), (low, right)))
        return np.array([sum(self._light(spots, u, v) for u, v in pair) for pair in pairs])

    def _sides(self, half_width: float, shift: float) -> tuple[RealArray, RealArray, RealArray]:
        """Shares of the cells on both sides of the split, and on the whole width without shift."""
        a, s = half_width / self.unit, shift / self.unit
        ends = ((s - a, s), (s, s + a), (-a, a))
        low, high, both = (share_within(self.place, *one) for one in ends)
        return low, high, both

    def _light(self, spots: RealArray, u: RealArray, v: RealArray) -> RealArray:
        light: RealArray = (spots @ v) @ u
        return light / CELLS_PER_UNIT**2


def extremes(errors: RealArray, signal: RealArray) -> float:
    """Distance [m] between the errors at the largest and the smallest signal (E,)."""
    return float(abs(errors[signal.argmax()] - errors[signal.argmin()]))


def half_range(errors: RealArray, signal: RealArray) -> float:
    """Width [m] of the range at whose ends the signal (E,) still has half of its extremes."""
    high = errors[signal >= signal.max() / 2]
    low = errors[signal <= signal.min() / 2]
    return float(max(high.max() - low.min(), low.max() - high.min()))


def gain(errors: RealArray, signal: RealArray) -> float:
    """Slope [1/m] of the signal (E,) at the error 0, the middle of the errors."""
    middle = len(errors) // 2
    rise = signal[middle + 1] - signal[middle - 1]
    return float(rise / (errors[middle + 1] - errors[middle - 1]))


def linear_range(errors: RealArray, signal: RealArray, within: float = 0.1) -> float:
    """Width [m] of the range about 0 in which the signal (E,) is within this share of
    its tangent.
    """
    middle = len(errors) // 2
    tangent = gain(errors, signal) * errors
    off = abs(signal - signal[middle] - tangent) > within * abs(tangent)
    off[middle] = False
    above, below = np.flatnonzero(off[middle:]), np.flatnonzero(off[middle::-1])
    return float(errors[middle + above[0]] - errors[middle - below[0]])
