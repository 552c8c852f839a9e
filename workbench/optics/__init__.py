"""Scalar optics of a scanning spot: spots on a detector, and layers of pits that reflect it."""

from workbench.optics.layers import Reading, TrackLayer, quadrants, read_layer
from workbench.optics.spots import Pupil, defocus, far_field, round_pupil, share_within, spot

__all__ = [
    "Pupil",
    "Reading",
    "TrackLayer",
    "defocus",
    "far_field",
    "quadrants",
    "read_layer",
    "round_pupil",
    "share_within",
    "spot",
]
