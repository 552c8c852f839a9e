"""Sums of polynomials times exponentials, sum p_k(s) exp(-s T_k), in exact and in ball arithmetic.

The characteristic function of a loop with dead times is one: its zeros are the closed loop's poles.
On a band of the imaginary axis it is enclosed by its mean value form; where the exponentials turn
by a large angle, its size is bounded by the sizes of its terms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from flint import acb, acb_poly, arb, arb_poly, fmpq, fmpq_poly

from workbench.certify.known_plants.exact_function import exact_rational


@dataclass(frozen=True, eq=False)
class QuasiPolynomial:
    """sum p_k(s) exp(-s T_k): polynomials by delay [s], the delays exact and not negative."""

    terms: Mapping[Fraction, fmpq_poly]

    def __add__(self, other: QuasiPolynomial) -> QuasiPolynomial:
        terms = dict(self.terms)
        for T, p in other.terms.items():
            terms[T] = terms.get(T, fmpq_poly([0])) + p
        return QuasiPolynomial({T: p for T, p in terms.items() if p})

    def __sub__(self, other: QuasiPolynomial) -> QuasiPolynomial:
        return self + other.scaled(-1.0)

    def scaled(self, factor: float) -> QuasiPolynomial:
        """The function times a number."""
        exact = exact_rational(factor)
        return QuasiPolynomial({T: exact * p for T, p in self.terms.items() if factor})

    def over(self, common: fmpq_poly) -> QuasiPolynomial:
        """The function divided by a polynomial that divides all of its terms."""
        return QuasiPolynomial({T: p // common for T, p in self.terms.items()})

    @property
    def order(self) -> int:
        """Degree of the term without delay."""
        return int(self.undelayed.degree())

    @property
    def undelayed(self) -> fmpq_poly:
        """The term without delay."""
        return self.terms.get(Fraction(0), fmpq_poly([0]))

    @cached_property
    def derivative(self) -> QuasiPolynomial:
        """sum (p_k' - T_k p_k) exp(-s T_k)."""
        slopes = {T: p.derivative() - _exact(T) * p for T, p in self.terms.items()}
        return QuasiPolynomial({T: p for T, p in slopes.items() if p})

    def __getstate__(self) -> dict[str, Any]:
        """State for another process: the balls are left out, since they are made there again."""
        return {"terms": self.terms}

    @cached_property
    def _balls(self) -> list[tuple[arb, acb_poly]]:
        return [(arb(_exact(T)), acb_poly(p)) for T, p in self.terms.items()]

    def at(self, omega: Any) -> acb:
        """The value at s = j omega; omega [rad/s] is a number or a ball."""
        s = acb(0, arb(omega))
        total = acb(0)
        for T, p in self._balls:
            total += p(s) * (-s * T).exp()
        return total

    def on(self, low: float, high: float) -> acb:
        """A ball that contains the values on a band of frequency [rad/s]."""
        plain = self.at(arb(low).union(arb(high)))
        middle = (arb(low) + arb(high)) / 2
        centred = self.at(middle.mid()) + self.derivative.at(arb(low).union(arb(high))) * acb(
            0, arb(0, (arb(high) - arb(low)) / 2)
        )
        return centred if _spread(centred) < _spread(plain) else plain

    def sizes(self, low: float, high: float) -> tuple[arb, arb]:
        """Bounds of the absolute value on a band, for any phases of the exponentials."""
        s = acb(0, arb(low).union(arb(high)))
        every = {T: abs(p(s)) for T, p in zip(self.terms, (p for _, p in self._balls), strict=True)}
        total = sum((size.abs_upper() for size in every.values()), arb(0))
        first = every.get(Fraction(0), arb(0))
        least = first.abs_lower() - (total - first.abs_upper())
        return least if least > 0 else arb(0), total

    def sums(self, radius: Any, order: int) -> tuple[arb, arb]:
        """Bounds of f(s) / s^order for |s| >= radius right of the axis and on it.

        The first bound is the size of the term with that power and no delay. The second one bounds
        all other terms together; it does not grow with the radius.
        """
        R = arb(radius)
        first, parts = self._absolute(order)
        return first, sum((p(R) for p in parts), arb(0)) / R**order

    def lower(self, radius: float, order: int) -> arb:
        """A bound of f(s) / s^order less its limit, for |s| >= radius right of the axis and on it.

        It does not grow with the radius.
        """
        R, total = arb(radius), arb(0)
        for p in self._absolute(order)[1]:
            total += sum((p[k] * R ** (k - order) for k in range(min(order, len(p)))), arb(0))
        return total

    def _absolute(self, order: int) -> tuple[arb, list[arb_poly]]:
        """The size of the first term of `sums`, and polynomials of the sizes of the others."""
        if order not in self._sizes:
            first, parts = arb(0), []
            for T, p in self.terms.items():
                sizes = [abs(arb(c)) for c in p.coeffs()]
                if T == 0 and order < len(sizes):
                    first, sizes[order] = sizes[order], arb(0)
                parts.append(arb_poly(sizes))
            self._sizes[order] = first, parts
        return self._sizes[order]

    @cached_property
    def _sizes(self) -> dict[int, tuple[arb, list[arb_poly]]]:
        return {}

    def leading(self, order: int) -> dict[Fraction, float]:
        """Limit of f(s) / s^order at infinity: the factor of each exponential, by delay."""
        return {T: float(arb(p[order])) for T, p in self.terms.items() if p[order]}


def without_common_factor(
    N: QuasiPolynomial, D: QuasiPolynomial
) -> tuple[QuasiPolynomial, QuasiPolynomial]:
    """The quotient N / D with common factors removed.

    If the quotient is a rational function times one exponential, it is returned in that form.
    """
    if not N.terms:
        return N, QuasiPolynomial({Fraction(0): fmpq_poly([1])})
    T0 = min(N.terms)
    p, q = N.terms[T0], D.undelayed
    alike = {T - T0 for T in N.terms} == set(D.terms)
    if alike and all(N.terms[T0 + T] * q == p * one for T, one in D.terms.items()):
        N, D = QuasiPolynomial({T0: p}), QuasiPolynomial({Fraction(0): q})
    common = fmpq_poly([0])
    for one in [*N.terms.values(), *D.terms.values()]:
        common = common.gcd(one)
    return N.over(common), D.over(common)


def _spread(ball: acb) -> arb:
    return (ball.real.rad() + ball.imag.rad()) if ball.is_finite() else arb("inf")


def _exact(T: Fraction) -> fmpq:
    return fmpq(T.numerator, T.denominator)
