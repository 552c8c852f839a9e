"""A real rational function as a product of quadratic factors, smooth in their coefficients.

A pair of poles may become real and complex again without a kink in the function. Where roots must
stay left of the imaginary axis, the parameters are logarithms of the coefficients: positive
coefficients of order two or less keep the roots there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.factored_values import LARGEST_LOGARITHM, factored_values
from workbench.fitting.rational import Rational

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


@dataclass(frozen=True)
class FactoredRational:
    """gain * prod(numerators) / prod(denominators), as a function of a vector of parameters (P,).

    Unlike a `Rational`, it is a function of its parameters, with derivatives for searches.

    The vector holds the parameters of every numerator factor, of every denominator factor, and the
    gain.
    """

    numerators: tuple[QuadraticFactor, ...]
    denominators: tuple[QuadraticFactor, ...]
    gain: float

    @classmethod
    def of(
        cls,
        start: Rational,
        zeros: int,
        band: tuple[float, float],
        stable: bool,
        minimum_phase: bool,
        unstable_poles: int = 0,
    ) -> FactoredRational:
        """The factored form that starts at a given function.

        Parameters
        ----------
        start
            The function at the start; its poles determine the order.
        zeros
            Largest number of zeros; those that ``start`` lacks begin at or near infinity.
        band
            Lowest and highest frequency of interest [rad/s], for the scales of the factors.
        stable, minimum_phase
            Whether the poles (``stable``) and the zeros (``minimum_phase``) must stay left of the
            imaginary axis; those of ``start`` on its right are mirrored.
        unstable_poles
            Number of poles of ``start`` that stay right of the axis instead.
        """
        if unstable_poles:
            right = start.poles.real > 0
            bottom, gain = _factors(
                start.poles[~right], start.order - unstable_poles, band, stable, monic=True
            )
            over, size = _factors(-start.poles[right], unstable_poles, band, True, monic=True)
            bottom += [replace(part, level=-part.level) for part in over]
            gain *= size * (-1) ** unstable_poles
        else:
            bottom, gain = _factors(start.poles, start.order, band, stable, monic=True)
        top, share = _factors(start.zeros, zeros, band, minimum_phase, monic=False)
        return cls(tuple(top), tuple(bottom), start.gain * share / gain)

    @property
    def parts(self) -> tuple[QuadraticFactor, ...]:
        """All factors, those of the numerator first."""
        return self.numerators + self.denominators

    @property
    def start(self) -> RealArray:
        """Vector of parameters (P,) of the starting function."""
        return np.concatenate([*(part.start for part in self.parts), [self.gain]])

    def _split(self, vector: Any) -> list[Any]:
        """The parameters of each factor."""
        ends = np.cumsum([0, *(len(part.moving) for part in self.parts)])
        return [vector[int(a) : int(b)] for a, b in pairwise(ends)]

    def products(
        self, vector: Any, omega: Any, exp: Callable[[Any], Any] | None = None
    ) -> tuple[Any, Any]:
        """Real and imaginary part of the values at frequencies [rad/s].

        ``vector``, ``omega`` and ``exp`` may be CasADi's; the parts are then expressions.
        """
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

    @cached_property
    def table(self) -> tuple[RealArray, RealArray, NDArray[np.bool_], NDArray[np.bool_], int]:
        """The factors as the arguments of `factored_values` that follow the parameters and
        frequencies.
        """
        parts = self.parts
        return (
            np.array([part.level for part in parts], dtype=float),
            np.array([part.coefficients for part in parts], dtype=float).reshape(-1, 3),
            np.array([[p in part.moving for p in range(3)] for part in parts]).reshape(-1, 3) != 0,
            np.array([part.positive for part in parts]) != 0,
            len(self.numerators),
        )

    @cached_property
    def second_order(self) -> tuple[RealArray, NDArray[np.bool_]]:
        """Data for second derivatives: factors (P, P), and which parameters are logarithms.

        The second derivative with respect to two parameters is the product of the two first
        derivatives divided by the value, times a factor. The factor is 1; if both parameters belong
        to the same factor it is 0 for the numerator and 2 for the denominator. If both are the same
        logarithm, the first derivative is added.
        """
        parts = self.parts
        counts = [len(part.moving) for part in parts]
        # the gain counts as a numerator
        of = np.append(np.repeat(np.arange(len(parts)), counts), -1)
        own = np.where(of >= len(self.numerators), 2.0, 0.0)
        factors = np.where(of[:, None] == of, own, 1.0)
        return factors, np.append(np.repeat([part.positive for part in parts], counts) != 0, False)

    def response(self, vector: RealArray, omega: RealArray) -> ComplexArray:
        """Values (F,) at frequencies (F,) [rad/s]."""
        return self.values(vector, omega)[0]

    def slopes(self, vector: RealArray, omega: RealArray) -> ComplexArray:
        """Derivatives (F, P) of the values with respect to the parameters."""
        return self.values(vector, omega)[1]

    def values(self, vector: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        """Values (F,) at frequencies (F,) [rad/s], and their derivatives (F, P)."""
        values, slopes = factored_values(vector, omega, *self.table)
        return values, slopes

    def rational(self, vector: RealArray) -> Rational:
        """The function at given parameters, by its roots and gain."""
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
    """Exponential of a value that is first limited to +- LARGEST_LOGARITHM."""
    return math.exp(max(-LARGEST_LOGARITHM, min(LARGEST_LOGARITHM, value)))


def _factors(
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


def _roots(coefficients: Sequence[float]) -> tuple[ComplexArray, float]:
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
