"""Light that a layer with pits in parallel tracks reflects into a lens, by scalar diffraction.

The layer is periodic, so it sends the illuminating pupil back in shifted copies; where copies
overlap in the pupil they interfere, and the interference changes as the spot moves. Lengths are in
wavelength / NA. H. H. Hopkins, Diffraction theory of laser read-out systems for optical video
discs, J. Opt. Soc. Am. 69 (1979); G. Bouwhuis et al., Principles of Optical Disc Systems (1985).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.optics.spots import Pupil


@dataclass(frozen=True)
class TrackLayer:
    """A layer with a row of equal rectangular pits along every track.

    pitch        distance of the tracks;
    period       distance from pit to pit along a track;
    length       length of a pit, at most the period; if equal, the pits form a groove;
    width        width of a pit, at most the pitch;
    phase        phase by which a pit delays the light, both ways [rad];
    reflection   amplitude that a pit reflects, relative to that of the land;
    stagger      shift of the pits from one track to the next, as a share of the period.

    Raises InputError for lengths outside these ranges.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import TrackLayer
    >>> groove = TrackLayer(pitch=1.6, period=1.0, length=1.0, width=0.8, phase=np.pi / 2)
    >>> groove.stagger, groove.reflection
    (0.0, 1.0)
    """

    pitch: float
    period: float
    length: float
    width: float
    phase: float
    _: KW_ONLY
    reflection: float = 1.0
    stagger: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 < self.length <= self.period and 0.0 < self.width <= self.pitch):
            raise InputError(f"{self}: need 0 < length <= period and 0 < width <= pitch")

    def orders(self) -> Iterator[tuple[int, float, float, complex]]:
        """Orders that reach the pupil: number along the track, frequencies along and across, size.

        They come sorted by their number along the track.
        """
        contrast = self.reflection * np.exp(1j * self.phase) - 1.0
        filled = self.length * self.width / (self.period * self.pitch)
        along = int(2.0 * self.period)
        for m in range(-along, along + 1):
            across = int(2.0 * self.pitch + abs(m * self.stagger)) + 1
            for n in range(-across, across + 1):
                f_x, f_y = m / self.period, (n - m * self.stagger) / self.pitch
                if np.hypot(f_x, f_y) >= 2.0:
                    continue
                shape = np.sinc(f_x * self.length) * np.sinc(f_y * self.width)
                yield m, f_x, f_y, filled * contrast * shape + (m == n == 0)


class Reading(NamedTuple):
    """Light on detectors while the spot runs along a track, as shares of a mirror's.

    mean (Y, D): averaged along the track. carrier (Y, D): amplitude of the pits' frequency, so that
    the light is mean + 2 Re(carrier exp(2 pi i x / period)) + harmonics.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import TrackLayer, quadrants, read_layer, round_pupil
    >>> pupil = round_pupil(32)
    >>> layer = TrackLayer(pitch=1.0, period=1.0, length=0.5, width=0.4, phase=np.pi / 2)
    >>> reading = read_layer(layer, pupil, np.array([0.0, 0.25]), quadrants(pupil))
    >>> reading.mean.shape, reading.carrier.shape
    ((2, 4), (2, 4))
    """

    mean: RealArray
    carrier: ComplexArray


Aberration = Callable[[RealArray], RealArray]
"""Path [wavelengths] that is added at distances from the pupil's centre, in its radii."""


def read_layer(
    layer: TrackLayer,
    pupil: Pupil,
    place: RealArray,
    detectors: RealArray,
    *,
    aberration: Aberration | None = None,
) -> Reading:
    """Reading of a layer at distances (Y,) from the middle of a track, by D detectors in the pupil.

    detectors (D, n, n): share of the light in each cell of the pupil that each detector receives.
    aberration: of the light that falls on the layer, such as a defocus.
    Raises InputError for detectors of another shape.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.optics import TrackLayer, quadrants, read_layer, round_pupil
    >>> pupil = round_pupil(32)
    >>> mirror = TrackLayer(pitch=1.6, period=1.0, length=0.5, width=0.4, phase=0.0)
    >>> reading = read_layer(mirror, pupil, np.array([0.0]), quadrants(pupil))
    >>> round(float(reading.mean.sum()), 6)  # a mirror sends back all the light
    1.0
    >>> groove = TrackLayer(pitch=1.6, period=1.0, length=1.0, width=0.8, phase=np.pi / 2)
    >>> asked = groove, pupil, np.array([0.0, 0.8]), quadrants(pupil)
    >>> sharp = read_layer(*asked).mean.sum(axis=1)
    >>> blurred = read_layer(*asked, aberration=lambda radius: 0.5 * radius**2).mean.sum(axis=1)
    >>> bool(np.ptp(blurred) < 0.5 * np.ptp(sharp))  # the tracks fade out of focus
    True
    """
    cells = pupil.share.shape
    if detectors.shape[1:] != cells:
        raise InputError(f"detectors are {detectors.shape}; the pupil has {cells} cells")
    taken = (detectors * pupil.share).reshape(len(detectors), -1)
    mirror = float((pupil.share * pupil.share**2).sum())
    mean = np.zeros((len(place), len(detectors)))
    carrier: ComplexArray = np.zeros(mean.shape, complex)
    last_number, last = -(10**9), np.zeros(0, complex)
    for number, field in _fields(layer, pupil, place, aberration):
        mean += abs(field) ** 2 @ taken.T
        if number == last_number + 1:
            carrier += (field * last.conj()) @ taken.T
        last_number, last = number, field
    carrier /= mirror
    return Reading(mean / mirror, carrier)


def _fields(
    layer: TrackLayer, pupil: Pupil, place: RealArray, aberration: Aberration | None
) -> Iterator[tuple[int, ComplexArray]]:
    """Fields (Y, n n) of the orders with the same number along the track, which interfere."""
    number, field = None, np.zeros((len(place), pupil.share.size), complex)
    for m, f_x, f_y, size in layer.orders():
        if m != number:
            if number is not None:
                yield number, field
            number, field = m, np.zeros_like(field)
        turn = size * np.exp(2j * np.pi * f_y * place)
        field += np.outer(turn, _shifted(pupil, f_x, f_y, aberration).ravel())
    if number is not None:
        yield number, field


def _shifted(pupil: Pupil, right: float, up: float, aberration: Aberration | None) -> Array:
    """Field (n, n) of the pupil moved along x and y: the share of each cell inside, with its
    phase.
    """
    distance = np.hypot((pupil.x - right)[:, None], pupil.x - up)
    share: RealArray = np.clip((1.0 - distance) / pupil.step + 0.5, 0.0, 1.0)
    if aberration is None:
        return share
    field: ComplexArray = share * np.exp(2j * np.pi * aberration(np.minimum(distance, 1.0)))
    return field


def quadrants(pupil: Pupil, *, shift: float = 0.0) -> RealArray:
    """Four quadrant detectors (4, n, n); their dividing line along x is moved by a shift.

    The first lies at x > 0 and y > shift, the second at x < 0 and y > shift.

    Examples
    --------
    >>> from workbench.optics import quadrants, round_pupil
    >>> detectors = quadrants(round_pupil(32))
    >>> detectors.shape, bool((detectors.sum(axis=0) == 1).all())
    ((4, 32, 32), True)
    """
    above = np.clip((pupil.x - shift) / pupil.step + 0.5, 0.0, 1.0)
    right = np.clip(pupil.x / pupil.step + 0.5, 0.0, 1.0)
    sides = ((right, above), (1 - right, above), (1 - right, 1 - above), (right, 1 - above))
    return np.array([np.outer(one, other) for one, other in sides])
