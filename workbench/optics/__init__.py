"""Scalar optics of a scanning spot: spots on a detector, and periodic layers that reflect it."""

from workbench.optics.spots import Pupil, defocus, far_field, round_pupil, share_within, spot

__all__ = [
    "Pupil",
    "defocus",
    "far_field",
    "round_pupil",
    "share_within",
    "spot",
]
