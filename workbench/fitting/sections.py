"""A real rational function as a product of sections of order two, smooth in its coefficients.

Poles may meet on the real axis and part again without a kink; where roots must stay left of the
imaginary axis the coefficients move on a logarithmic scale, and so cannot leave it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational

NEAREST = 1e-9
"""Least coefficient, over the largest, of a section that starts on a logarithmic scale."""
NEGLIGIBLE = 1e-30
"""A leading coefficient, over the largest, that puts a root at infinity."""
REACH = 40.0
"""Largest logarithm of a coefficient, either way: beyond it a root is nowhere near the data."""
FAR = 1e3
"""Where zeros start that a function lacks but may not have at infinity, over the band."""


@dataclass(frozen=True)
class Section:
    """c0 + c1 (s / level) + c2 (s / level)^2, of which some coefficients move and one is held."""

    level: float
    coefficients: RealArray
    moving: tuple[int, ...]
    positive: bool

    @property
    def start(self) -> RealArray:
        values = self.coefficients[list(self.moving)]
        return np.log(values) if self.positive else values

    def at(self, moved: Any, exp: Callable[[Any], Any] | None = None) -> list[Any]:
        """The three coefficients for given values of those that move."""
        exp = exp or bounded_exp
        values: list[Any] = self.coefficients.tolist()
        for i, power in enumerate(self.moving):
            values[power] = exp(moved[i]) if self.positive else moved[i]
        return values


@dataclass(frozen=True)
class Sections:
    """gain * prod(numerators) / prod(denominators) over a vector of parameters.

    The vector holds the moving coefficients of every numerator, of every denominator, the gain.
    """

    numerators: tuple[Section, ...]
    denominators: tuple[Section, ...]
    gain: float

    @classmethod
    def of(
        cls,
        start: Rational,
        zeros: int,
        band: tuple[float, float],
        stable: bool,
        minimum_phase: bool,
    ) -> Sections:
        """Sections that hold a function and every other one of its order near it.

        Parameters
        ----------
        zeros
            How many zeros the function may have; those it lacks start at infinity.
        band
            Lowest and highest frequency of interest [rad/s], for the scales of the sections.
        stable, minimum_phase
            Keep the poles, the zeros left of the imaginary axis; those of ``start`` are mirrored.
        """
        bottom, gain = _sections(start.poles, start.order, band, stable, monic=True)
        top, share = _sections(start.zeros, zeros, band, minimum_phase, monic=False)
        return cls(tuple(top), tuple(bottom), start.gain * share / gain)

    @property
    def parts(self) -> tuple[Section, ...]:
        return self.numerators + self.denominators

    @property
    def start(self) -> RealArray:
        return np.concatenate([*(part.start for part in self.parts), [self.gain]])

    def _split(self, vector: Any) -> list[Any]:
        """The parameters of each section."""
        ends = np.cumsum([0, *(len(part.moving) for part in self.parts)])
        return [vector[int(a) : int(b)] for a, b in pairwise(ends)]

    def products(
        self, vector: Any, omega: Any, exp: Callable[[Any], Any] | None = None
    ) -> tuple[Any, Any]:
        """Real and imaginary part over frequencies; in a CasADi graph with its ``exp``."""
        real, imaginary = vector[-1], 0.0
        count = len(self.numerators)
        for i, (part, moved) in enumerate(zip(self.parts, self._split(vector), strict=True)):
            c0, c1, c2 = part.at(moved, exp)
            x = omega / part.level
            u, v = c0 - c2 * x * x, c1 * x
            if i >= count:
                size = u * u + v * v
                u, v = u / size, -v / size
            real, imaginary = real * u - imaginary * v, real * v + imaginary * u
        return real, imaginary

    def response(self, vector: RealArray, omega: RealArray) -> ComplexArray:
        """Values at frequencies (F,) [rad/s]."""
        real, imaginary = self.products(vector, omega)
        return real + 1j * imaginary * np.ones(omega.size)

    def slopes(self, vector: RealArray, omega: RealArray) -> ComplexArray:
        """Derivatives of the values by the parameters, (F, P)."""
        count = len(self.numerators)
        factors, powers = [], []
        for part, moved in zip(self.parts, self._split(vector), strict=True):
            c = np.array(part.at(moved))
            x = omega / part.level
            power = np.column_stack([np.ones(x.size, dtype=complex), 1j * x, -x * x])
            factors.append(power @ c)
            moving = list(part.moving)
            powers.append(power[:, moving] * (c[moving] if part.positive else 1.0))
        bottom = np.prod(factors[count:], axis=0) * np.ones(omega.size)
        bare = np.prod(factors[:count], axis=0) / bottom
        columns = []
        for i, power in enumerate(powers):
            if i < count:  # one may be zero at a frequency: it is left out, not divided by
                others = [factor for k, factor in enumerate(factors[:count]) if k != i]
                outer = vector[-1] * np.prod(others, axis=0) / bottom
            else:
                outer = -vector[-1] * bare / factors[i]
            columns.append(outer[:, None] * power)
        return np.hstack([*columns, bare[:, None]])

    def rational(self, vector: RealArray) -> Rational:
        """The function itself, by its roots."""
        gain = float(vector[-1])
        count = len(self.numerators)
        roots: list[ComplexArray] = []
        for i, (part, moved) in enumerate(zip(self.parts, self._split(vector), strict=True)):
            found, leading = _roots(part.at(moved))
            roots.append(found * part.level)
            leading /= part.level**found.size
            gain = gain * leading if i < count else gain / leading
        none = np.zeros(0, dtype=complex)
        return Rational(
            np.concatenate([none, *roots[:count]]), np.concatenate([none, *roots[count:]]), gain
        )


def bounded_exp(value: float) -> float:
    return math.exp(max(-REACH, min(REACH, value)))


def _sections(
    roots: ComplexArray, count: int, band: tuple[float, float], left: bool, monic: bool
) -> tuple[list[Section], float]:
    """Sections of ``count`` roots, and the factor that prod(s - roots) is of their product."""
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
            polynomial = np.convolve(polynomial, [1.0, level / (FAR * band[1]) if left else 0.0])
        if left:  # a coefficient of zero has no logarithm
            polynomial = np.maximum(polynomial, NEAREST * polynomial.max())
        held = group.size if monic else int(np.argmax(np.abs(polynomial)))
        factor *= polynomial[held]
        moving = tuple(power for power in range(group.size + 1) if power != held)
        coefficients = np.zeros(3)
        coefficients[: group.size + 1] = polynomial / polynomial[held]
        found.append(Section(level, coefficients, moving, left))
    return found, factor


def _roots(coefficients: Sequence[float]) -> tuple[ComplexArray, float]:
    """Roots of c0 + c1 s + c2 s^2 in exact conjugate pairs, and the leading coefficient."""
    c0, c1, c2 = (float(c) for c in coefficients)
    if abs(c2) < NEGLIGIBLE * max(abs(c0), abs(c1)):
        if abs(c1) < NEGLIGIBLE * abs(c0) or c1 == 0:
            return np.zeros(0, dtype=complex), c0
        return np.array([-c0 / c1], dtype=complex), c1
    half, square = -c1 / (2 * c2), (c1 / (2 * c2)) ** 2 - c0 / c2
    if square < 0:
        root = complex(half, np.sqrt(-square))
        return np.array([root, root.conjugate()]), c2
    far = half + np.copysign(np.sqrt(square), half)  # no cancellation
    near = c0 / c2 / far if far else 0.0
    return np.array([far, near], dtype=complex), c2
