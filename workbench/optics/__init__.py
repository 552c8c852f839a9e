"""Scalar optics of a scanning spot: spots on a detector, and layers of pits that reflect it.

Takes: wavelength, aperture, defocus, and the layer.
Gives: the light on each part of a detector.
Rests on: scalar diffraction in Fraunhofer's approximation.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.optics.layers import Reading, TrackLayer, quadrants, read_layer
from workbench.optics.spots import Pupil, defocus, round_pupil, share_within, spot

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "Pupil",
    "Reading",
    "TrackLayer",
    "defocus",
    "quadrants",
    "read_layer",
    "round_pupil",
    "share_within",
    "spot",
]
