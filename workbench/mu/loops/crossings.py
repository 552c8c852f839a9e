"""Crossings of a loop's response with the unit circle and the real axis, by exact arithmetic.

Every double is a rational number, so the transfer function of a system is known exactly, and with s
= j omega both |L|^2 - 1 and the imaginary part of L are polynomials of x = omega^2 over positive
ones. All their roots are isolated: no crossing is missed, and none is an effect of rounding; an
integrator has its pole exactly at 0. A sampled loop is mapped to the plane s = (z - 1) / (z + 1)
first, which moves z = 1 to 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import acb, acb_mat, acb_poly, arb, ctx, fmpq, fmpq_poly, fmpz_mat

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.known_plants.exact_function import (
    ExactFunction,
    exact_rational,
    exact_square,
    products,
)
from workbench.systems.axis_poles import POLE_ROUNDINGS, pole_may_be_at

PRECISION = 192
"""Precision [bits] of balls in exact margins, and at which roots are isolated. It is 3.6 times that
of a double, so that polynomials of some twenty states may cancel. With half of it multiple roots
are less accurate than doubles, and zeros next to the axis stay undecided; double takes longer.
"""
MODULUS_ROUNDING = 1e-12
"""Share by which a modulus is rounded down. The value is rounded to a double from many bits, so
1e-15 suffices; the rest lets another linear algebra library prove it. Half or double changes the
twelfth digit.
"""
TOUCHING = 1e-7
"""Roots x closer than this to each other or to the real axis, relative to their size, count as one
crossing: a curve that touches its line in exact arithmetic has such roots in doubles. A double root
moves by the root of its rounding, 1e-8. With half of it such a root may count as two or none; with
double of it two true crossings a part in 1e7 apart count as one.
"""


@dataclass(frozen=True)
class Crossing:
    """A frequency [rad/s] of the loop, and the response there."""

    omega: float
    value: complex


@dataclass(frozen=True, eq=False)
class ExactLoop:
    """A loop of one channel with exact coefficients, in the plane where s = j x^(1/2).

    Unlike a `StateSpace`, it has exact coefficients, so that no crossing is missed.

    ``system`` has its states; ``period`` [s] is 0 in continuous time.
    """

    function: ExactFunction
    system: StateSpace
    period: float

    def unit_crossings(self) -> list[Crossing]:
        """Crossings with |L| = 1, from low to high frequencies."""
        L = self.function
        return self._at_roots(exact_square(L.numerator) - exact_square(L.denominator))

    def real_crossings(self) -> list[Crossing]:
        """Crossings with L real and not 0, up to infinity or to half the sampling rate."""
        L = self.function
        inside = self._at_roots(products(L.numerator, L.denominator)[1])
        ends = [self._at_zero(), self._at_infinity()]
        real = [Crossing(one.omega, complex(one.value.real)) for one in (*ends, *inside) if one]
        return sorted((one for one in real if self._seen(one)), key=lambda one: one.omega)

    def stable(self) -> bool:
        """Whether the loop with negative feedback is stable, and remains so under rounding."""
        closed = self.function.numerator + self.function.denominator
        degree = max(self.function.numerator.degree(), self.function.denominator.degree())
        if closed.degree() < degree or self.function.denominator.degree() < self.system.nstates:
            return False  # a pole at infinity or at half the sampling rate
        with ctx.workprec(PRECISION):
            roots: Any = closed.complex_roots() if degree else []
            poles = [root for root, _ in roots]
            if not all(pole.real < 0 for pole in poles):
                return False
            nearest = [self._angular(abs(pole.imag) ** 2) for pole in poles]
        return not any(self.may_be_unstable(omega) for omega in nearest)

    def modulus(self) -> float:
        """The least |1 + L| of a stable loop, found where its derivative is 0, rounded down.

        The polynomials are those of x, and the bound is proven by `exceeds`.
        """
        above, below = self._squares()
        with ctx.workprec(PRECISION):
            flat = positive_roots(above.derivative() * below - above * below.derivative())
            every = [acb_poly(above)(acb(x)) / acb_poly(below)(acb(x)) for x in flat]
            sizes = [arb(value.real).sqrt() for value in every if value.is_finite()]
        ends = [abs(1.0 + end.value) for end in (self._at_zero(), self._at_infinity()) if end]
        return min([*map(float, sizes), *ends]) * (1.0 - MODULUS_ROUNDING)

    def exceeds(self, modulus: float) -> bool:
        """Whether |1 + L| is proven to be at least ``modulus`` at every frequency."""
        above, below = self._squares()
        rest = above - exact_rational(modulus) ** 2 * below
        signs = [rest[0], rest[max(rest.degree(), 0)]]
        roots: Any = rest.complex_roots() if rest.degree() > 0 else []
        crossed = any(k % 2 and root.imag == 0 and not root.real < 0 for root, k in roots if root)
        return all(sign >= 0 for sign in signs) and not crossed

    def _squares(self) -> tuple[fmpq_poly, fmpq_poly]:
        """|N + D|^2 and |D|^2."""
        L = self.function
        return exact_square(L.numerator + L.denominator), exact_square(L.denominator)

    def response(self, omega: RealArray) -> ComplexArray:
        """L at frequencies [rad/s] (F,), infinity and half the sampling rate among them."""
        end = math.pi / self.period if self.period else math.inf
        with ctx.workprec(PRECISION):
            values = [self._ratio(-1) if w >= end else self._value(self._plane(w)) for w in omega]
            return np.array([complex(acb(value)) for value in values], dtype=complex)

    def _plane(self, omega: float) -> acb:
        """s in the plane, for a frequency [rad/s] of the loop itself."""
        return acb(0, (arb(omega) * self.period / 2).tan() if self.period else arb(omega))

    def _at_roots(self, polynomial: fmpq_poly) -> list[Crossing]:
        with ctx.workprec(PRECISION):
            found = [(x, self._angular(x)) for x in positive_roots(polynomial)]
            values = [complex(self._value(acb(0, x.sqrt()))) for x, _ in found]
            pairs = zip(found, values, strict=True)
            every = [Crossing(omega, value) for (_, omega), value in pairs]
        return [one for one in every if self._seen(one)]

    def _value(self, s: acb) -> acb:
        L = self.function
        return acb_poly(L.numerator)(s) / acb_poly(L.denominator)(s)

    def _ratio(self, power: int) -> fmpq:
        power = self.function.denominator.degree() if power < 0 else power
        return self.function.numerator[power] / self.function.denominator[power]

    def _angular(self, x: arb) -> float:
        """The frequency [rad/s] of the loop itself, for one in the plane."""
        root = x.sqrt()
        return float(root.atan() * 2 / self.period) if self.period else float(root)

    def _at_zero(self) -> Crossing | None:
        if self.function.denominator[0] == 0:
            return None
        return Crossing(0.0, complex(_double(self._ratio(0))))

    def _at_infinity(self) -> Crossing | None:
        degree = self.function.denominator.degree()
        end = math.pi / self.period if self.period else math.inf
        if self.function.numerator.degree() > degree:
            return None
        return Crossing(end, complex(_double(self._ratio(degree))))

    def _seen(self, at: Crossing) -> bool:
        """Whether a crossing is more than rounding: a finite gain moves it to -1, and the response
        is not all rounding.
        """
        if not POLE_ROUNDINGS * EPS * abs(at.value) < 1.0:  # or a pole, up to rounding
            return False
        if not self.system.nstates or not math.isfinite(at.omega):
            return abs(at.value) > 0.0
        with ctx.workprec(PRECISION):
            try:
                value, size = self._terms(at.omega)
            except ZeroDivisionError:
                return False
            return bool(abs(value) > POLE_ROUNDINGS * EPS * size)

    def _terms(self, omega: float) -> tuple[acb, arb]:
        """The response of the realisation, and the sum of the sizes of its terms.

        Close to a pole that exists only by rounding, the resolvent in doubles has no correct digit.
        """
        L, n = self.system, self.system.nstates
        turn = arb(omega) * self.period
        point = acb(turn.cos(), turn.sin()) if self.period else acb(0, omega)
        eye = acb_mat(np.eye(n).tolist())
        R = (point * eye - acb_mat(L.A.tolist())).inv()
        value, size = acb(L.D[0, 0]), arb(abs(L.D[0, 0]))
        for i, j in np.argwhere((L.C.T != 0.0) & (L.B.T != 0.0)).tolist():
            term = R[i, j] * acb(L.C[0, i]) * acb(L.B[j, 0])
            value, size = value + term, size + abs(term)
        return value, size

    def may_be_unstable(self, omega: float, gain: float = 1.0) -> bool:
        """Whether rounding of L's entries, with a gain, may put a closed-loop pole at omega."""
        L, factor = self.system, gain / (1.0 + gain * self.system.D[0, 0])
        entries = np.abs(L.A) + abs(factor) * np.abs(L.B) @ np.abs(L.C)
        return pole_may_be_at(self._point(omega), L.A - factor * L.B @ L.C, entries)

    def _point(self, omega: float) -> complex:
        """The point of the boundary of stability, s or z, at a frequency [rad/s]."""
        return complex(np.exp(1j * omega * self.period) if self.period else 1j * omega)


def exact_loop(given: Any, L: StateSpace) -> ExactLoop:
    """The loop with the exact coefficients of a given transfer function, or of L."""
    import control

    if isinstance(given, control.TransferFunction):
        numerator, denominator = (
            fmpq_poly([exact_rational(c) for c in part[0][0][::-1]])
            for part in (given.num, given.den)
        )
    else:
        numerator, denominator = _characteristic(L.A, L.B, L.C, float(L.D[0, 0]))
    if L.dt:
        order = max(numerator.degree(), denominator.degree())
        numerator, denominator = (_bilinear(part, order) for part in (numerator, denominator))
    return ExactLoop(ExactFunction(numerator, denominator), L, float(L.dt or 0.0))


def _characteristic(
    A: RealArray, B: RealArray, C: RealArray, D: float
) -> tuple[fmpq_poly, fmpq_poly]:
    """Exact numerator and denominator of a realisation, by det(s I - A + B C) + (D - 1) det(s I -
    A).
    """
    if not len(A):
        return exact_rational(D) * fmpq_poly([1]), fmpq_poly([1])
    n = len(A)
    ratios = [[float(x).as_integer_ratio() for x in part.ravel()] for part in (A, B, C)]
    bits = [max((q.bit_length() - 1 for _, q in part), default=0) for part in ratios]
    scale = max(bits[0], bits[1] + bits[2])  # common denominator of A; B and C share theirs
    powers = scale, bits[1], scale - bits[1]
    a, b, c = (
        fmpz_mat(len(part), part.shape[1], [p * (1 << power) // q for p, q in ratio])
        for part, ratio, power in zip((A, B, C), ratios, powers, strict=True)
    )
    unit = fmpq_poly([0, 1 << scale])  # scale s to the eigenvalues of the integer matrix
    poles, zeros = (fmpq_poly(M.charpoly())(unit) / (1 << n * scale) for M in (a, a - b * c))
    return zeros + (exact_rational(D) - 1) * poles, poles


def _bilinear(polynomial: fmpq_poly, order: int) -> fmpq_poly:
    """(1 - s)^order p((1 + s) / (1 - s))."""
    up, down = fmpq_poly([1, 1]), fmpq_poly([1, -1])
    total = fmpq_poly([0])
    for power, coefficient in enumerate(polynomial.coeffs()):
        total += coefficient * up**power * down ** (order - power)
    return total


def positive_roots(polynomial: fmpq_poly) -> list[arb]:
    """Positive roots, each once, and positive real parts of roots that are real up to rounding."""
    if polynomial.degree() < 1:
        return []
    found: list[arb] = []
    # python-flint's type annotation leaves multiplicities out
    roots: Any = polynomial.complex_roots()
    for root, _ in roots:
        x, y = root.real.mid(), root.imag.mid()
        if x > 0 and abs(y) <= TOUCHING * x:
            found.append(x)
    found.sort(key=float)
    return [x for k, x in enumerate(found) if not k or x - found[k - 1] > TOUCHING * x]


def _double(value: fmpq) -> float:
    with ctx.workprec(PRECISION):
        return float(arb(value))
