"""All constant gains that stabilise a plant of one input and output, decided in exact fractions.

Let p(s) = det(s I - A) and n(s) = p(s) G(s). With positive feedback u = k y the closed loop has the
characteristic polynomial f = p - k n. As k moves along the real line, poles cross the axis only
where f has a root on it, at 0, or at infinity. With s^2 = v, f = e(v) + s o(v). A root on the axis
is a common root of e and o, and there the resultant R(k) of e and o with respect to v is zero. So
between two neighbouring real roots of R(k), of f's leading coefficient and of f(0), all gains give
the same number of stable poles; Routh's array counts them for one gain. If R is zero for every k, e
and o have a common factor for every k. Then f has roots symmetric to the axis and no gain
stabilises, since the stabilising gains are an open set.

Source: F. R. Gantmacher, The Theory of Matrices II (1959), chapter XV (Routh and Hurwitz; Orlando's
formula).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flint import fmpq, fmpq_mat, fmpq_poly

from workbench._core.heavy_types import StateSpace
from workbench.certify.interlacing import as_fraction, exact_matrix


@dataclass(frozen=True)
class GainRange:
    """A range of gains between two that put a pole on the axis, or up to infinity.

    ``low`` and ``high`` are fractions just inside the ends of the range; None: infinity. Either all
    gains in the range stabilise or none does, as ``stabilises`` says.
    """

    low: Any
    high: Any
    stabilises: bool

    @property
    def middle(self) -> fmpq:
        """A gain of the range."""
        if self.low is None and self.high is None:
            return fmpq(0)
        if self.low is None or self.high is None:
            end, sign = (self.high, -1) if self.low is None else (self.low, 1)
            return end + sign * (abs(end) if end else fmpq(1))
        return (self.low + self.high) / 2


def gain_ranges(plant: StateSpace) -> list[GainRange]:
    """The ranges of gains k, from minus to plus infinity, in each of which a continuous plant has
    equally many stable poles.

    plant: one input and one output; u = k y with positive feedback. Between the ranges lie single
    gains that put a pole on the axis. If every gain leaves a pole there, the result is one range
    without ends.
    """
    p, n = _polynomials(plant)
    ends = _crossings(p, n)
    if ends is None:
        return [GainRange(None, None, False)]
    lows = [None, *(high for _, high in ends)]
    highs = [*(low for low, _ in ends), None]
    found = []
    for low, high in zip(lows, highs, strict=True):
        one = GainRange(low, high, False)
        found.append(GainRange(low, high, is_hurwitz(p - one.middle * n)))
    return found


def is_hurwitz(f: fmpq_poly) -> bool:
    """Whether all roots have negative real parts, by Routh's array."""
    first = [f[k] for k in range(f.degree(), -1, -2)]
    second = [f[k] for k in range(f.degree() - 1, -1, -2)]
    if f.is_zero():
        return False
    sign = 1 if first[0] > 0 else -1
    for _ in range(f.degree()):
        if not second or sign * second[0] <= 0:
            return False
        ratio = first[0] / second[0]
        rest = second[1:] + [fmpq(0)] * (len(first) - len(second))
        first, second = second, [a - ratio * b for a, b in zip(first[1:], rest, strict=True)]
    return True


def _polynomials(plant: StateSpace) -> tuple[fmpq_poly, fmpq_poly]:
    """p and n of a plant; n = det(s I - A + b c) - p + d p."""
    A, b, c = (exact_matrix(part) for part in (plant.A, plant.B, plant.C))
    p = A.charpoly()
    return p, (A - b * c).charpoly() + (as_fraction(plant.D[0, 0]) - 1) * p


def _crossings(p: fmpq_poly, n: fmpq_poly) -> list[tuple[fmpq, fmpq]] | None:
    """Disjoint ranges in order, each with gains that may put a pole on the axis or at infinity.

    None: with every gain there is a root on the axis, or two roots that are symmetric to it.
    """
    order = p.degree()
    at_zero = fmpq_poly([p[0], -n[0]])
    leading = fmpq_poly([p[order], -n[order]])
    resultant = _resultant(p, n)
    if not (at_zero and resultant):
        return None
    found: list[tuple[fmpq, fmpq]] = []
    product = at_zero * leading * resultant
    once = product / product.gcd(product.derivative())
    roots: Any = once.numer().complex_roots() if once.degree() > 0 else []
    for root, _ in roots:
        if root.imag == 0:
            found.append((_fraction(root.real.lower()), _fraction(root.real.upper())))
    return sorted(found)


def _resultant(p: fmpq_poly, n: fmpq_poly) -> fmpq_poly:
    """R(k) of the even and odd parts of p - k n, as the polynomial through its values."""
    order = p.degree()
    # its degree is at most order: the rows of the Sylvester matrix are linear in k
    count = order + 1
    points: list[int] = []
    values: list[fmpq] = []
    k = 1
    while len(points) < count:
        # If the leading coefficient is zero, the resultant would have another matrix.
        f = p - k * n
        if f.degree() == order:
            even = fmpq_poly([f[i] for i in range(0, order + 1, 2)])
            odd = fmpq_poly([f[i] for i in range(1, order + 1, 2)])
            points.append(k)
            values.append(_sylvester(even, odd, order))
        k = -k if k > 0 else 1 - k
    return _interpolating_polynomial(points, values)


def _sylvester(even: fmpq_poly, odd: fmpq_poly, order: int) -> fmpq:
    """Determinant of the Sylvester matrix of both parts, for their largest possible degrees."""
    m, k = order // 2, (order - 1) // 2
    if order < 2:
        return fmpq(1)
    rows = []
    for part, degree, shifts in ((even, m, k), (odd, k, m)):
        coefficients = [part[i] for i in range(degree, -1, -1)]
        for shift in range(shifts):
            rows += [fmpq(0)] * shift + coefficients + [fmpq(0)] * (shifts - 1 - shift)
    size = m + k
    return fmpq_mat(size, size, rows).det() if size else fmpq(1)


def _interpolating_polynomial(points: list[int], values: list[fmpq]) -> fmpq_poly:
    """The polynomial through values at points, by Newton's divided differences."""
    table = list(values)
    for level in range(1, len(points)):
        for i in range(len(points) - 1, level - 1, -1):
            table[i] = (table[i] - table[i - 1]) / (points[i] - points[i - level])
    found = fmpq_poly([])
    for point, value in zip(reversed(points), reversed(table), strict=True):
        found = found * fmpq_poly([-point, 1]) + value
    return found


def _fraction(end: Any) -> fmpq:
    """An exact ball of radius zero as a fraction."""
    mantissa, exponent = end.mid().man_exp()
    power = fmpq(2) ** abs(int(exponent))
    return fmpq(mantissa) * power if exponent >= 0 else fmpq(mantissa) / power
