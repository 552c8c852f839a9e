"""Interface of circles and stadiums: a centre, a radius, a half-length and an angle."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Shape(Protocol):
    """Circles or stadiums, as arrays over the sets; a circle's half-length and angle are 0."""

    @property
    def center(self) -> np.ndarray: ...
    @property
    def radius(self) -> np.ndarray: ...
    @property
    def half_length(self) -> np.ndarray: ...
    @property
    def angle(self) -> np.ndarray: ...
