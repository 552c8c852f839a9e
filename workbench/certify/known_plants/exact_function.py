"""Rational functions of s with exact coefficients: every double is a rational number.

On the imaginary axis s = j omega the square of the magnitude and the real part of a product are
polynomials of x = omega^2; their signs are decided exactly.
"""

from __future__ import annotations

import copyreg
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from flint import acb, arb, ctx, fmpq, fmpq_poly

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.rounding import BALL_BITS
from workbench.errors import InputError

X = fmpq_poly([0, 1])
"""The variable x = omega^2."""


@dataclass(frozen=True, eq=False)
class ExactFunction:
    """numerator / denominator, polynomials in s [rad/s] with rational coefficients.

    Unlike a `TransferFunction`, it has exact coefficients.
    """

    numerator: fmpq_poly
    denominator: fmpq_poly

    def __sub__(self, other: ExactFunction) -> ExactFunction:
        numerator = self.numerator * other.denominator - other.numerator * self.denominator
        return _reduced(numerator, self.denominator * other.denominator)

    def __truediv__(self, other: ExactFunction) -> ExactFunction:
        numerator = self.numerator * other.denominator
        return _reduced(numerator, self.denominator * other.numerator)

    @property
    def relative_degree(self) -> int:
        """Number of poles less the number of zeros."""
        return int(self.denominator.degree() - self.numerator.degree())

    def response(self, omega: RealArray) -> ComplexArray:
        """Values on the imaginary axis at angular frequencies [rad/s] (F,), correctly rounded."""
        before, ctx.prec = ctx.prec, BALL_BITS
        try:
            points = [acb(0, arb(float(w))) for w in omega]
            values = [self._at(self.numerator, s) / self._at(self.denominator, s) for s in points]
            return np.array([complex(value) for value in values], dtype=complex)
        finally:
            ctx.prec = before

    @staticmethod
    def _at(polynomial: fmpq_poly, s: acb) -> acb:
        value = acb(0)
        for coefficient in reversed(polynomial.coeffs()):
            value = value * s + arb(coefficient)
        return value


class Factored(Protocol):
    """gain * prod(s - zeros) / prod(s - poles), complex roots in exact conjugate pairs."""

    @property
    def zeros(self) -> ComplexArray: ...

    @property
    def poles(self) -> ComplexArray: ...

    @property
    def gain(self) -> float: ...


def exact_function(system: Factored) -> ExactFunction:
    """The function with the roots and the gain of a system, taken as exact doubles."""
    return _reduced(exact_rational(system.gain) * monic(system.zeros), monic(system.poles))


def exact_rational(value: Any) -> fmpq:
    """A double as an exact rational number."""
    value = float(value)
    if not np.isfinite(value):
        raise InputError(f"exact arithmetic needs finite numbers, one is {value}")
    return fmpq(*value.as_integer_ratio())


def monic(roots: Iterable[complex]) -> fmpq_poly:
    """Real polynomial with these roots, complex ones in exact conjugate pairs."""
    product = fmpq_poly([1])
    for root in roots:
        re, im = exact_rational(root.real), exact_rational(root.imag)
        if im > 0:
            product *= fmpq_poly([re * re + im * im, -2 * re, 1])
        elif im == 0:
            product *= fmpq_poly([-re, 1])
    return product


def even_odd(f: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """Polynomials a, b of x = omega^2 with f(j omega) = a + j omega b."""
    c = f.coeffs()
    even, odd = (
        fmpq_poly([-k if i % 2 else k for i, k in enumerate(part)]) for part in (c[0::2], c[1::2])
    )
    return even, odd


def exact_square(f: fmpq_poly) -> fmpq_poly:
    """|f(j omega)|^2 as a polynomial of x."""
    a, b = even_odd(f)
    return a * a + X * b * b


def products(f: fmpq_poly, g: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """Re(f g*) and Im(f g*) / omega at s = j omega, as polynomials of x."""
    (a, b), (c, d) = even_odd(f), even_odd(g)
    return a * c + X * b * d, b * c - a * d


def _parts_of_number(value: fmpq) -> tuple[type[fmpq], tuple[int, int]]:
    return fmpq, (int(value.p), int(value.q))


def _parts_of_polynomial(value: fmpq_poly) -> tuple[type[fmpq_poly], tuple[list[fmpq]]]:
    return fmpq_poly, (value.coeffs(),)


copyreg.pickle(fmpq, _parts_of_number)  # FLINT's own classes cannot be pickled for another process
copyreg.pickle(fmpq_poly, _parts_of_polynomial)


def _reduced(numerator: fmpq_poly, denominator: fmpq_poly) -> ExactFunction:
    """The quotient with common factors removed."""
    if not denominator.degree() >= 0:
        raise InputError("a quotient by the zero function has no values")
    common = numerator.gcd(denominator)
    return ExactFunction(numerator // common, denominator // common)
