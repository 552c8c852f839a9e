"""The last step of every magnitude fit: the best gain for given roots, and coverage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.magnitude.squared import left_half_plane
from workbench.fitting.rational import Rational

if TYPE_CHECKING:
    from workbench.fitting.magnitude.program import MagnitudeFit

COVER_GAIN_MARGIN = 1e-9
"""Relative increase of a cover's gain, so that rounding cannot put it below the data. It is above
the rounding of responses, so that a raise covers at once. Half or double: sets are 1e-9 smaller or
larger.
"""
VALLEY_SAMPLES = 8
"""Number of samples in each interval of the data in the search for the fit's lowest points."""


@dataclass(frozen=True)
class Target:
    """Magnitudes to fit or to cover.

    ``omega`` (F,) [rad/s] rises; ``magnitude`` (F,) and ``weight`` (F,) belong to it. For a cover,
    points between the data may be added; their weight 0 says that only the lower limit matters
    there.
    """

    omega: RealArray
    magnitude: RealArray
    weight: RealArray
    cover: bool

    def limits(self, error: float) -> tuple[RealArray, RealArray]:
        """Smallest and largest (may be infinite) |W| / m (F,) that a worst error allows."""
        with np.errstate(divide="ignore"):
            high = 1 + error / self.weight
        return (np.ones_like(high) if self.cover else np.maximum(2 - high, 0)), high

    def ratio(self, shape: Rational) -> RealArray:
        """|W| / m (F,) of a function."""
        return np.asarray(np.abs(shape.response(self.omega)) / self.magnitude)

    def best(self, shape: Rational) -> tuple[float, Rational]:
        """Smallest worst error over all gains of a function, and the function with that gain."""
        ratio = self.ratio(shape)
        if not np.all(np.isfinite(ratio) & (ratio > 0)):
            return np.inf, shape
        if self.cover:
            gain = 1 / ratio.min()
            return float(np.max(self.weight * (gain * ratio - 1))), shape.scaled(gain)
        error = 0.0
        # Newton's method ends at the zero of this concave piecewise linear function.
        for _ in range(100):
            low, high = self.limits(error)
            i, j = int(np.argmin(high / ratio)), int(np.argmax(low / ratio))
            above, below = ratio[i], ratio[j]
            needed = (above - below) / (above / self.weight[j] + below / self.weight[i])
            if not needed > error * (1 + 1e-15):
                break
            error = float(needed)
        low, high = self.limits(error)
        gain = (np.min(high / ratio) + np.max(low / ratio)) / 2
        return error, shape.scaled(gain)

    def with_valleys(self, shape: Rational) -> tuple[Target, float]:
        """Target with the fit's local minima between the data added, and the smallest ratio."""
        u, data = np.log(self.omega), np.log(self.magnitude)
        steps = np.linspace(0, 1, VALLEY_SAMPLES, endpoint=False)
        fine = (u[:-1, None] + np.diff(u)[:, None] * steps).ravel()
        fine = np.unique(np.concatenate([fine, u[-1:], _frequencies_near_roots(shape, u)]))

        def height(v: RealArray) -> RealArray:
            return np.log(np.abs(shape.response(np.exp(v)))) - np.interp(v, u, data)

        h = height(fine)
        inner = np.flatnonzero((h[1:-1] <= h[:-2]) & (h[1:-1] <= h[2:])) + 1
        at = fine[inner]
        width = np.maximum(at - fine[inner - 1], fine[inner + 1] - at)
        for _ in range(12):  # zoom in on every valley
            around = at[:, None] + width[:, None] * np.linspace(-1, 1, 9)
            around = np.clip(around, u[0], u[-1])
            lowest = np.argmin(height(around), axis=1)
            at, width = around[np.arange(at.size), lowest], width / 4
        least = float(np.exp(min(h.min(), height(at).min(initial=np.inf))))
        new = np.setdiff1d(np.exp(at), self.omega)
        omega = np.append(self.omega, new)
        order = np.argsort(omega)
        magnitude = np.append(self.magnitude, np.exp(np.interp(np.log(new), u, data)))
        weight = np.append(self.weight, np.zeros(new.size))
        return replace(
            self, omega=omega[order], magnitude=magnitude[order], weight=weight[order]
        ), least


def _frequencies_near_roots(shape: Rational, u: RealArray) -> RealArray:
    """Logarithms of frequencies close around each complex root, within the range of u.

    They resolve each resonance, however sharp.
    """
    roots = np.concatenate([shape.zeros, shape.poles])
    roots = roots[roots.imag > 0]
    away = np.append(0, 2.0 ** np.arange(-2, 24))
    spread = np.outer(np.abs(roots.real / roots), np.concatenate([-away[::-1], away]))
    near = np.log(np.abs(roots))[:, None] + np.clip(spread, -0.1, 0.1)
    return near[(near > u[0]) & (near < u[-1])]


def target_of(program: MagnitudeFit) -> Target:
    """The data of a program as a target."""
    return Target(program.omega, program.magnitude, program.weight, program.cover)


def with_best_gain(target: Target, zeros: ComplexArray, poles: ComplexArray) -> Rational:
    """Stable, minimum-phase function with given roots, mirrored where needed, and the best gain.

    For a cover the gain also covers the data between their frequencies.
    """
    shape = Rational(
        left_half_plane(zeros, target.omega), left_half_plane(poles, target.omega), 1.0
    )
    _, shape = target.best(shape)
    if not target.cover:
        return shape
    _, least = target.with_valleys(shape)
    return shape.scaled((1 + COVER_GAIN_MARGIN) / least)
