"""Factors c0 + c1 x + c2 x^2 of a rational function: parameters, starting values and roots."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.factored_values import LARGEST_LOGARITHM

MIN_STARTING_COEFFICIENT = 1e-9
"""Smallest starting coefficient on a logarithmic scale, relative to the largest of its factor."""
INFINITE_ROOT = 1e-30
"""A root counts as infinite if the leading coefficient, relative to the largest coefficient of its
factor, is below this.
"""
MISSING_ZERO_FACTOR = 1e3
"""Start of zeros that the function lacks: this many times the band's highest frequency [rad/s]."""


@dataclass(frozen=True)
class QuadraticFactor:
    """Polynomial c0 + c1 (s / level) + c2 (s / level)^2 with some free coefficients and one fixed.

    Parameters
    ----------
    level
        Frequency [rad/s] that scales s; a negative one mirrors the roots at the imaginary axis.
    coefficients
        Starting values (3,) of c0, c1 and c2.
    moving
        Powers whose coefficients are free.
    positive
        Whether the free coefficients must stay positive; their logarithms are then the parameters.
    """

    level: float
    coefficients: RealArray
    moving: tuple[int, ...]
    positive: bool

    @property
    def start(self) -> RealArray:
        """Parameters of the starting coefficients."""
        values = self.coefficients[list(self.moving)]
        return np.log(values) if self.positive else values

    def at(self, moved: Any, exp: Callable[[Any], Any] | None = None) -> list[Any]:
        """The three coefficients for given parameters; ``exp`` serves symbolic parameters."""
        exp = exp or bounded_exp
        values: list[Any] = self.coefficients.tolist()
        for i, power in enumerate(self.moving):
            values[power] = exp(moved[i]) if self.positive else moved[i]
        return values


def bounded_exp(value: float) -> float:
    """Exponential of a value that is first limited to +- LARGEST_LOGARITHM."""
    return math.exp(max(-LARGEST_LOGARITHM, min(LARGEST_LOGARITHM, value)))


def factors_with(
    roots: ComplexArray, count: int, band: tuple[float, float], left: bool, monic: bool
) -> tuple[list[QuadraticFactor], float]:
    """Factors with ``count`` roots, and the ratio of their product to prod(s - roots).

    If fewer roots are given, the others are infinite, or far away if ``left`` requires positive
    coefficients.
    """
    if left:
        roots = -np.abs(roots.real) + 1j * roots.imag
    groups = [np.array([root, root.conjugate()]) for root in roots[roots.imag > 0]]
    real = roots[roots.imag == 0]
    real = real[np.argsort(np.abs(real))]
    groups += [real[i : i + 2] for i in range(0, real.size, 2)]
    missing = count - sum(len(group) for group in groups)
    if missing and groups and len(groups[-1]) == 1:
        groups[-1] = np.append(groups[-1], np.inf)
        missing -= 1
    groups += [np.full(2, np.inf)] * (missing // 2) + [np.full(1, np.inf)] * (missing % 2)
    found, factor = [], 1.0
    for group in groups:
        finite = group[np.isfinite(group)]
        sizes = np.abs(finite) if finite.size else np.array([band[1]])
        level = float(np.clip(np.exp(np.mean(np.log(np.maximum(sizes, band[0])))), *band))
        polynomial = np.atleast_1d(np.poly(finite / level)).real[::-1]
        factor *= level**finite.size
        for _ in range(group.size - finite.size):
            polynomial = np.convolve(
                polynomial, [1.0, level / (MISSING_ZERO_FACTOR * band[1]) if left else 0.0]
            )
        if left:  # zero has no logarithm
            polynomial = np.maximum(polynomial, MIN_STARTING_COEFFICIENT * polynomial.max())
        held = group.size if monic else int(np.argmax(np.abs(polynomial)))
        factor *= polynomial[held]
        moving = tuple(power for power in range(group.size + 1) if power != held)
        coefficients = np.zeros(3)
        coefficients[: group.size + 1] = polynomial / polynomial[held]
        found.append(QuadraticFactor(level, coefficients, moving, left))
    return found, factor


def roots_of(coefficients: Sequence[float]) -> tuple[ComplexArray, float]:
    """Roots of c0 + c1 s + c2 s^2, complex ones exactly conjugate, and the leading coefficient."""
    c0, c1, c2 = (float(c) for c in coefficients)
    if abs(c2) < INFINITE_ROOT * max(abs(c0), abs(c1)):
        if abs(c1) < INFINITE_ROOT * abs(c0) or c1 == 0:
            return np.zeros(0, dtype=complex), c0
        return np.array([-c0 / c1], dtype=complex), c1
    half, square = -c1 / (2 * c2), (c1 / (2 * c2)) ** 2 - c0 / c2
    if square < 0:
        root = complex(half, np.sqrt(-square))
        return np.array([root, root.conjugate()]), c2
    far = half + np.copysign(np.sqrt(square), half)  # this sign avoids cancellation
    near = c0 / c2 / far if far else 0.0
    return np.array([far, near], dtype=complex), c2
