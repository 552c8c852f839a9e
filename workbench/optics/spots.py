"""Spots of a round pupil on a detector near its focus, by scalar diffraction.

Coordinates of the pupil are in its radii, and those of the detector in wavelength / NA, both on its
side. J. W. Goodman, Introduction to Fourier Optics (2005), chapters 4 and 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError


@dataclass(frozen=True, eq=False)
class Pupil:
    """A round pupil of radius 1 on a square grid.

    x: coordinates (n,) of the cells' centres along either side. share: part of each cell (n, n)
    that lies inside. Fields are indexed [x, y].

    Examples
    --------
    >>> from workbench.optics import round_pupil
    >>> pupil = round_pupil(32)
    >>> round(float(pupil.share.sum() * pupil.step**2), 2)  # pi
    3.14
    """

    x: RealArray
    share: RealArray

    @property
    def step(self) -> float:
        """Width of a cell."""
        return float(self.x[1] - self.x[0])

    @property
    def radius(self) -> RealArray:
        """Distance (n, n) of each cell from the centre, 1 at most."""
        distance: RealArray = np.minimum(np.hypot(self.x[:, None], self.x), 1.0)
        return distance


def round_pupil(samples: int) -> Pupil:
    """Pupil with this many cells along its diameter. Raises InputError for fewer than 8 cells.

    Examples
    --------
    >>> from workbench.optics import round_pupil
    >>> pupil = round_pupil(16)
    >>> pupil.share.shape, pupil.step
    ((16, 16), 0.125)
    """
    if samples < 8:
        raise InputError(f"a pupil of {samples} cells; it needs 8 at least")
    x = (np.arange(samples) - 0.5 * (samples - 1)) * 2.0 / samples
    share = np.clip((1.0 - np.hypot(x[:, None], x)) * samples / 2.0 + 0.5, 0.0, 1.0)
    return Pupil(x, share)


def defocus(pupil: Pupil, NA: float) -> RealArray:
    """Change of the path length (n, n) at the pupil when a point source moves away from it by 1.

    The pupil obeys the sine condition with the numerical aperture NA, between 0 and 1. A mirror
    that moves by 1 adds twice as much. Raises InputError for another aperture.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import defocus, round_pupil
    >>> pupil = round_pupil(32)
    >>> path = defocus(pupil, NA=0.45)
    >>> bool(np.ptp(path[pupil.share == 1]) < 1 - np.sqrt(1 - 0.45**2))
    True
    """
    if not 0.0 < NA < 1.0:
        raise InputError(f"NA is {NA}; it must lie between 0 and 1")
    path: RealArray = 1.0 - np.sqrt(1.0 - (NA * pupil.radius) ** 2)
    return path


def spot(pupil: Pupil, field: ComplexArray, place: RealArray) -> RealArray:
    """Intensity (N, N) of a field (n, n) of the pupil at the places (N,) along either side.

    Intensities are shares of the light of a uniform pupil per square of the unit wavelength / NA.
    The spot repeats every n / 2 units: places and spot have to fit in between.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import round_pupil, spot
    >>> pupil = round_pupil(64)
    >>> airy = spot(pupil, pupil.share.astype(complex), np.array([0.0, 0.61]))
    >>> round(float(airy[0, 0]), 2)  # pi
    3.14
    >>> bool(airy[1, 0] < 1e-3 * airy[0, 0])  # the dark ring at 0.61 wavelength / NA
    True
    """
    amplitude = far_field(pupil, field, place)
    return np.asarray(abs(amplitude) ** 2 / np.pi, float)


def far_field(pupil: Pupil, field: ComplexArray, place: RealArray) -> ComplexArray:
    """Amplitude (N, N) of a field (n, n) of the pupil at the places (N,) along either side.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import round_pupil, spot
    >>> from workbench.optics.spots import far_field
    >>> pupil, place = round_pupil(32), np.array([0.0, 0.5])
    >>> field = pupil.share.astype(complex)
    >>> amplitude = far_field(pupil, field, place)
    >>> light = spot(pupil, field, place)
    >>> bool(np.allclose(abs(amplitude / amplitude[0, 0]) ** 2, light / light[0, 0]))
    True
    """
    turn = np.exp(2j * np.pi * np.outer(place, pupil.x)) * pupil.step
    amplitude: ComplexArray = turn @ field @ turn.T
    return amplitude


def share_within(place: RealArray, low: ArrayLike, high: ArrayLike) -> RealArray:
    """Share (..., N) of each cell around equally spaced places (N,) between low and high (...).

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import share_within
    >>> share_within(np.array([0.0, 1.0, 2.0]), 0.25, 1.5).tolist()
    [0.25, 1.0, 0.0]
    """
    step = place[1] - place[0]
    left, right = (
        np.clip((np.asarray(end, float)[..., None] - place) / step + 0.5, 0.0, 1.0)
        for end in (low, high)
    )
    share: RealArray = right - left
    return share
