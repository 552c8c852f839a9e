"""Light of three beams on the five diodes of a hologram pickup, by rays (figure 3.11).

A hologram parts the returning light. One half of the pupil falls on D1 and D2, which meet at the
focus of the main beam, and the other half on D3. S1 and S2 stand on both sides of D1 and D2 and
receive the side beams. A layer at the distance e from the focus widens each beam to a half disc of
radius 2 NA e. Lengths on the diodes are divided by the magnification: they are lengths at the disc,
u across the line at which D1 and D2 meet, v along it. Each ray is a Gaussian spot as wide as a
focused beam and the ray's share of the half disc together; no interference is modelled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from workbench.errors import InputError
from workbench.types import RealArray

from ...drive.tables import disc_formats

DIODES = ("D1", "D2", "D3", "S1", "S2")
RAYS = 16
"""Number of rays along the radius of the pupil."""
SPOT = 0.42
"""Standard deviation of a focused beam, in wavelength / (2 NA); fits the middle of Airy's spot."""


@dataclass(frozen=True)
class Layout:
    """Sizes and places of diodes and beams, as lengths at the disc [m].

    half_width: of D1 and D2 each, across their common line; half_length: along it. apart: distance
    of the side beams from the main one. side_width, side_length: half sizes of S1 and S2.
    side_light: light of one side beam over that of the main one. shift: displacement (2,) of all
    beams on the diodes, across and along the line.

    Raises InputError if the side diodes would overlap the middle ones.
    """

    half_width: float
    half_length: float
    apart: float
    side_width: float
    side_length: float
    side_light: float
    shift: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.half_length + self.side_length <= self.apart:
            raise InputError(
                f"the side beams are {self.apart} m apart; diodes of the half lengths "
                f"{self.half_length} m and {self.side_length} m would overlap"
            )

    def light(self, error: RealArray) -> RealArray:
        """Light (5, E) on DIODES at focus errors [m] (E,), over that of the main beam's half."""
        (u, v), width = _rays(error), _spread(error)
        a, b, c, wide = self.half_width, self.half_length, self.side_length, self.side_width
        across, along = self.shift

        def share(beside: float, low: tuple[float, float], high: tuple[float, float]) -> RealArray:
            """Light (E,) of a beam, shifted along the line, on the diode between two corners."""
            places = u + across, v + along + beside
            return np.prod(
                [_within(*one, width) for one in zip(places, low, high, strict=True)], axis=0
            ).mean(axis=1)

        middle = [((-a, -b), (0.0, b)), ((0.0, -b), (a, b))]
        sides = [((-wide, s * self.apart - c), (wide, s * self.apart + c)) for s in (1, -1)]
        beams = ((1.0, 0.0), (self.side_light, self.apart), (self.side_light, -self.apart))
        d1, d2, s1, s2 = (
            sum(size * share(beside, *corners) for size, beside in beams)
            for corners in (*middle, *sides)
        )
        # D3 stands alone, as wide as D1 and D2 together; the other half falls on its middle
        return np.array([d1, d2, share(0.0, (-a, -b), (a, b)), s1, s2])


def normalised(light: RealArray) -> tuple[RealArray, RealArray, RealArray]:
    """Focus error by the sum of D1 and D2, by D3, and radial error, each (E,), of lights (5, E)."""
    d1, d2, d3, s1, s2 = light
    focus: RealArray = (d2 - d1) / (d1 + d2)
    by_d3: RealArray = (d2 - d1) / d3
    radial: RealArray = (s1 - s2) / (s1 + s2)
    return focus, by_d3, radial


def _rays(error: RealArray) -> tuple[RealArray, RealArray]:
    """Where rays of equal light of half a pupil fall at each error (E, N), along both axes."""
    x = (np.arange(-RAYS, RAYS) + 0.5) / RAYS
    across, along = (one.ravel() for one in np.meshgrid(x[x > 0.0], x, indexing="ij"))
    inside = np.hypot(across, along) <= 1.0
    reach = 2.0 * disc_formats()["CD"].NA * error[:, None]
    return reach * across[inside], reach * along[inside]


def _spread(error: RealArray) -> RealArray:
    """Standard deviation [m] of a ray's spot at each error (E, 1)."""
    disc = disc_formats()["CD"]
    focused, patch = SPOT * disc.wavelength / (2 * disc.NA), disc.NA * error / RAYS
    return np.hypot(focused, patch)[:, None]


def _within(place: RealArray, low: float, high: float, width: RealArray) -> RealArray:
    """Share of spots at these places (E, N), of widths (E, 1), that falls between low and high."""
    share: RealArray = ndtr((high - place) / width) - ndtr((low - place) / width)
    return share
