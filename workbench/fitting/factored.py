"""A real rational function as a product of quadratic factors, smooth in their coefficients.

A pair of poles may become real and complex again without a kink in the function. Where roots must
stay left of the imaginary axis, the parameters are logarithms of the coefficients: positive
coefficients of order two or less keep the roots there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.factored_values import factored_values
from workbench.fitting.quadratic_factor import QuadraticFactor, factors_with, roots_of
from workbench.fitting.rational import Rational
from workbench.fitting.sections import PolynomialSections

Pair = tuple[Any, Any]
"""Real and imaginary part, as numbers, arrays or expressions of CasADi."""


@dataclass(frozen=True)
class FactoredRational:
    """gain * prod(numerators) / prod(denominators), as a function of a vector of parameters (P,).

    Unlike a `Rational`, it is a function of its parameters, with derivatives for searches.

    The vector holds the parameters of every numerator factor, of every denominator factor, and the
    gain. ``values`` are compiled, for searches of many steps, and right at zeros of the function.
    ``log_magnitude`` is for stable functions with stable inverses, and ``products`` for graphs of
    CasADi.
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
        monic: bool = False,
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
        monic
            Whether numerators have leading coefficients 1 as denominators have, instead of the
            largest coefficient. The gain is then that of infinite frequency.
        """
        if unstable_poles:
            right = start.poles.real > 0
            bottom, gain = factors_with(
                start.poles[~right], start.order - unstable_poles, band, stable, monic=True
            )
            over, size = factors_with(-start.poles[right], unstable_poles, band, True, monic=True)
            bottom += [replace(part, level=-part.level) for part in over]
            gain *= size * (-1) ** unstable_poles
        else:
            bottom, gain = factors_with(start.poles, start.order, band, stable, monic=True)
        top, share = factors_with(start.zeros, zeros, band, minimum_phase, monic=monic)
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

    def products(self, vector: Any, s: Pair, exp: Callable[[Any], Any] | None = None) -> Pair:
        """Real and imaginary part of the values at points, given by real and imaginary part.

        ``vector``, ``s`` and ``exp`` may be CasADi's; the parts are then expressions.
        """
        real, imaginary = vector[-1], 0.0
        count = len(self.numerators)
        for i, (part, moved) in enumerate(zip(self.parts, self._split(vector), strict=True)):
            c0, c1, c2 = part.at(moved, exp)
            x, y = s[0] / part.level, s[1] / part.level
            u, v = c0 + c1 * x + c2 * (x * x - y * y), (c1 + 2 * c2 * x) * y
            if i >= count:
                size = u * u + v * v
                u, v = u / size, -v / size
            real, imaginary = complex_product((real, imaginary), (u, v))
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

    def log_magnitude(self, vector: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Log-magnitudes (F,) at frequencies (F,) [rad/s], and their derivatives (F, P).

        The parameters of all factors must be logarithms.
        """
        level, _, moving, positive, count = self.table
        assert positive.all()
        parts = zip(self.parts, self._split(vector), strict=True)
        c0, c1, c2 = np.reshape([part.at(moved) for part, moved in parts], (-1, 3)).T[..., None]
        sections = PolynomialSections.at(omega / level[:, None], c0, c1, c2)
        signs = np.where(np.arange(len(level)) < count, 1.0, -1.0)
        first, second = sections.magnitude_shares
        slopes = np.stack([1 - first - second, first, second], axis=1) * signs[:, None, None]
        by_gain = np.full((1, omega.size), 1 / vector[-1])
        value = np.log(abs(vector[-1])) + signs @ sections.log_magnitude
        return value, np.concatenate([slopes[moving], by_gain]).T

    def rational(self, vector: RealArray) -> Rational:
        """The function at given parameters, by its roots and gain."""
        gain = float(vector[-1])
        count = len(self.numerators)
        roots: list[ComplexArray] = []
        for i, (part, moved) in enumerate(zip(self.parts, self._split(vector), strict=True)):
            found, leading = roots_of(part.at(moved))
            roots.append(found * part.level)
            leading /= part.level**found.size
            gain = gain * leading if i < count else gain / leading
        none = np.zeros(0, dtype=complex)
        return Rational(
            np.concatenate([none, *roots[:count]]), np.concatenate([none, *roots[count:]]), gain
        )


def complex_product(a: Pair, b: Pair) -> Pair:
    """Product of complex numbers given by real and imaginary part."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]
