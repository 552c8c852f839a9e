"""The T = L / (1 + L) that a loop may have at a frequency where mu is at most a level.

Without uncertainty they fill a disc. With it their set has no simple shape; polygons hold it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.geometry import smallest_circle
from workbench.geometry.circle import Circle
from workbench.synthesis.limits.loop_weights import LoopWeights

TURNS, PHASES = 96, 12
"""Number of parts into which the angle of T, and phi, are divided."""


class AllowedSets(Protocol):
    """Sets (F,) of complex numbers T."""

    @property
    def empty(self) -> bool:
        """Whether one of them has no number."""

    @property
    def circle(self) -> Circle:
        """Circles around them, where none is empty."""

    def support(self, h: ComplexArray) -> RealArray:
        """Largest Re(T h), or more, at h (F,)."""


@dataclass(frozen=True)
class Discs:
    """Discs about ``center`` (F,) of ``squared`` radius (F,), negative where there is none."""

    center: RealArray
    squared: RealArray

    @property
    def empty(self) -> bool:
        return bool((self.squared < 0.0).any())

    @property
    def circle(self) -> Circle:
        return Circle(self.center, np.sqrt(self.squared))

    def support(self, h: ComplexArray) -> RealArray:
        found: RealArray = self.center * h.real + np.sqrt(self.squared) * np.abs(h)
        return found


@dataclass(frozen=True)
class Polygons:
    """Hulls of corners (F, V), NaN where there is no corner."""

    corners: ComplexArray

    @property
    def empty(self) -> bool:
        return bool(np.isnan(self.corners).all(axis=1).any())

    @property
    def circle(self) -> Circle:
        missing = np.isnan(self.corners)
        one = np.take_along_axis(self.corners, missing.argmin(axis=1)[:, None], axis=1)
        return smallest_circle(np.where(missing, one, self.corners))

    def support(self, h: ComplexArray) -> RealArray:
        along = (self.corners * h[:, None]).real
        found: RealArray = np.where(np.isnan(along), -np.inf, along).max(axis=1)
        return found


def allowed_discs(weights: LoopWeights, level: float) -> Discs:
    """The T of nominal loops with |(W_p (1 - T), W_u T / G)| at most a level, exactly.

    The circular and the real weight are not looked at.
    """
    W_p, W_u = weights.performance**2, weights.control**2
    whole = W_p + W_u
    return Discs(W_p / whole, (level**2 - W_p * W_u / whole) / whole)


def allowed_polygons(weights: LoopWeights, level: float) -> Polygons:
    """Polygons that hold every T with mu at most a level, and little more.

    For T = r exp(j psi) and a phi

        r (|W_c| + |W_r cos(angle of W_r + psi - phi)|) + |(W_p (1 - T), W_u T / G)|
            <= level cos(phi)

    is an interval of r. On parts of psi and of phi, each term has its least and the right side its
    largest value, so that the interval holds all of theirs.
    """
    W_p, W_u, W_c = (
        getattr(weights, name)[:, None, None] for name in ("performance", "control", "circular")
    )
    W_r, along = np.abs(weights.real)[:, None, None], np.angle(weights.real)[:, None, None]
    # |1 - T| W_p is at most the level, and so is every other term.
    near = level < W_p
    widest = np.where(near, np.arcsin(np.minimum(level / W_p, 1.0)), np.pi)
    largest = np.minimum(1 + level / W_p, level / (W_c + W_u))
    steepest = np.arcsin(np.minimum(W_r * largest / level, 1.0))
    psi = widest * np.linspace(-1, 1, TURNS + 1)[:, None]
    phi = steepest * np.linspace(-1, 1, PHASES + 1)
    first, last = along + psi[:, :-1] - phi[..., 1:], along + psi[:, 1:] - phi[..., :-1]
    slope = W_c + W_r * _least_cosine(first, last)
    right = level * np.cos(np.minimum(np.abs(phi[..., :-1]), np.abs(phi[..., 1:])))
    cosine = np.cos(np.minimum(np.abs(psi[:, :-1]), np.abs(psi[:, 1:])))
    # slope r + sqrt(whole r^2 - 2 W_p^2 cosine r + W_p^2) <= right
    whole = W_p**2 + W_u**2
    middle, left = W_p**2 * cosine - right * slope, whole - slope**2
    discriminant = middle**2 - left * (W_p**2 - right**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(discriminant)
        high = np.where(middle > 0, (middle + root) / left, (right**2 - W_p**2) / (root - middle))
        low = np.where(W_p <= right, 0.0, (middle - root) / left)
        held = (discriminant >= 0) & (high >= 0) & (slope * high <= right)
    high = np.where(held, high, -np.inf).max(axis=2)
    low = np.where(held, low, np.inf).min(axis=2)
    none = high < 0
    arc = np.cos((psi[:, 1:] - psi[:, :-1])[..., 0] / 2)  # chords of it lie inside the circle
    ends = np.exp(1j * np.concatenate([psi[:, :-1], psi[:, 1:]], axis=1)[..., 0])
    sizes = [np.where(none, np.nan, each) for each in (low, high / arc)]
    return Polygons(np.concatenate([np.tile(size, 2) * ends for size in sizes], axis=1))


def _least_cosine(first: RealArray, last: RealArray) -> RealArray:
    """Least |cos| between two angles."""
    crossed = np.floor((last - np.pi / 2) / np.pi) > np.floor((first - np.pi / 2) / np.pi)
    found: RealArray = np.where(
        crossed, 0.0, np.minimum(np.abs(np.cos(first)), np.abs(np.cos(last)))
    )
    return found
