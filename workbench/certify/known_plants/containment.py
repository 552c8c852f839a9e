"""Containment of known plants in the sets of an uncertainty model, decided at every frequency.

At s = j omega the set is a stadium: the points within r of the segment from -e to e, about the
nominal; without a segment it is a circle. With a = u / D, e = v / D, r^2 = W / (Z |D|^2) and
x = omega^2, the plant at a is in the set if and only if

    |u - v|^2 Z <= W   or   |u + v|^2 Z <= W   (near an end of the segment), or
    |v|^2 >= |Re u v*|   and   (Im u v*)^2 Z <= W |v|^2   (beside the segment).

All of these compare polynomials of x, so the answer changes at their real roots only. Roots are
isolated in ball arithmetic; between two of them one point decides, exactly. The largest excess
is found by raising the radius to the worst of these points until no point is outside (as Boyd
and Balakrishnan (1990) do for the H-infinity norm).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from typing import Any

from flint import ctx, fmpq, fmpq_poly, fmpz_poly

from workbench.certify.known_plants.exact_function import (
    ExactFunction,
    Factored,
    X,
    exact_function,
    exact_rational,
    exact_square,
    products,
)
from workbench.errors import SolverError

LEVEL_TOLERANCE = 1e-10
"""Distance of a proven bound above the largest excess found, relative to the radius. Half or
double: at most one Newton step more or less.
"""
UNBOUNDED = 2.0**100
"""A plant counts as infinitely far outside from this distance on, relative to the radius. Only a
plant with a pole on the axis is that far outside, next to its pole. Half or double changes nothing.
"""
FAR = 2**150
"""Ratio between the outermost root and the value of omega^2 that stands for 0 or infinity. There
omega is 2^75 away from the root, and a response differs from its limit by less than doubles show.
Half or double changes nothing.
"""
MOST_STEPS = 100
"""Largest number of increases of the radius for one plant; the quadratic convergence needs about
six. From half of them on, the accepted tolerance doubles with each. With half of them a plant whose
points are nearly equal may end in an error; double costs time only.
"""
BITS = (64, 256, 1024, 4096, 16384)
"""Precisions [bits] at which roots are isolated, in turn until roots of different polynomials
separate. Each has four times as many bits as the one before. Half or double of all changes the
time, and how close the closest roots may be.
"""


@dataclass(frozen=True)
class Excess:
    """The largest distance of plants beyond their sets, over all frequencies.

    ``value`` is a proven upper bound, relative to the radius and less 1: negative inside. ``omega``
    [rad/s] is the frequency at which the plant of index ``plant`` comes within LEVEL_TOLERANCE of
    the bound; it may be 0 or infinity.
    """

    value: float
    omega: float
    plant: int


def largest_excess(
    plants: Sequence[Factored],
    nominal: Factored,
    W_c: Factored,
    W_r: Factored | None = None,
    *,
    multiplicative: bool = True,
) -> Excess:
    """Largest distance of plants beyond G (1 + W_c delta_c + W_r delta_r), at every frequency.

    Parameters
    ----------
    plants, nominal, W_c, W_r
        Functions by exact zeros, poles and gain; W_r = None gives circles.
    multiplicative
        Whether the weights are relative to the nominal; otherwise they are added to it.

    Raises
    ------
    SolverError
        The roots of a comparison cannot be isolated.
    """
    worst = Excess(LEVEL_TOLERANCE - 1, 0.0, 0)
    for index, compared in enumerate(_comparisons(plants, nominal, W_c, W_r, multiplicative)):
        worst = _excess_with_plant(compared, worst, index)
        if math.isinf(worst.value):
            break
    return worst


def escapes(
    plants: Sequence[Factored],
    nominal: Factored,
    W_c: Factored,
    W_r: Factored | None,
    excess: float,
    *,
    multiplicative: bool = True,
) -> list[float]:
    """Frequencies [rad/s] at which plants lie outside sets whose radius is 1 + `excess` times W_c.

    There is one frequency for each plant and each interval in which it is outside. An empty result
    proves that all plants are inside at every frequency. The arguments are those of
    `largest_excess`.
    """
    compared = _comparisons(plants, nominal, W_c, W_r, multiplicative)
    return [omega for each in compared for _, omega in each.outside(excess)]


def _comparisons(
    plants: Sequence[Factored],
    nominal: Factored,
    W_c: Factored,
    W_r: Factored | None,
    multiplicative: bool,
) -> Iterator[_Comparison]:
    """The comparisons of each plant with its sets."""
    G, c = exact_function(nominal), exact_function(W_c)
    r = None if W_r is None else exact_function(W_r)
    for plant in plants:
        difference = exact_function(plant) - G
        yield _Comparison.of(difference / G if multiplicative else difference, c, r)


@dataclass(frozen=True, eq=False)
class _Comparison:
    """The polynomials of x in the module's docstring, for one plant.

    ``inside`` and ``beyond`` are |v|^2 - Re u v* and |v|^2 + Re u v*; ``across`` is
    (Im u v*)^2, ``near`` and ``opposite`` are |u - v|^2 and |u + v|^2.
    """

    W: fmpq_poly
    Z: fmpq_poly
    along: fmpq_poly
    inside: fmpq_poly
    beyond: fmpq_poly
    across: fmpq_poly
    near: fmpq_poly
    opposite: fmpq_poly

    @classmethod
    def of(cls, a: ExactFunction, c: ExactFunction, r: ExactFunction | None) -> _Comparison:
        u, D = a.numerator, a.denominator
        v = fmpq_poly([0])
        if r is not None:
            u, v, D = u * r.denominator, r.numerator * D, D * r.denominator
        along = exact_square(v)
        re, im = products(u, v)
        return cls(
            exact_square(c.numerator * D),
            exact_square(c.denominator),
            along,
            along - re,
            along + re,
            X * im * im,
            exact_square(u - v),
            exact_square(u + v),
        )

    def squares(self, x: fmpq) -> tuple[fmpq, fmpq]:
        """Squares of the distance from the segment and of the radius at omega^2 = x.

        Both are multiplied by |D|^2 Z.
        """
        along = self.along(x)
        if along > 0 and self.inside(x) >= 0 and self.beyond(x) >= 0:
            distance = self.across(x) / along
        else:
            distance = min(self.near(x), self.opposite(x))
        return distance * self.Z(x), self.W(x)

    def outside(self, value: float) -> list[tuple[float, float]]:
        """Points at which the plant leaves sets of 1 + `value` times the radius, one for each
        interval.

        Each point has a distance relative to the radius, and its frequency [rad/s].
        """
        most = (1 + exact_rational(value)) ** 2
        parts = [most * self.W - self.Z * self.near]
        if self.along.degree() >= 0:
            parts += [most * self.W - self.Z * self.opposite]
            parts += [most * self.W * self.along - self.Z * self.across]
            parts += [self.inside, self.beyond]
        found = []
        for x, omega in _between_roots(parts):
            distance, radius = self.squares(x)
            if distance > most * radius:
                found.append((_root(distance / radius) if radius > 0 else math.inf, omega))
        return found


def _excess_with_plant(compared: _Comparison, worst: Excess, index: int) -> Excess:
    """The worst excess, updated by a further plant: the radius is raised until none of its points
    is outside.
    """
    tolerance = LEVEL_TOLERANCE
    for step in range(MOST_STEPS):
        outside = compared.outside(worst.value)
        if not outside:
            return worst
        ratio, omega = max(outside)
        if ratio >= UNBOUNDED:
            return Excess(math.inf, omega, index)
        worst = Excess(ratio * (1 + tolerance) - 1, omega, index)
        if step > MOST_STEPS // 2:
            tolerance *= 2
    raise SolverError(f"the largest excess of plant {index + 1} is not found: {worst}")


def _between_roots(polynomials: list[fmpq_poly]) -> list[tuple[fmpq, float]]:
    """A point x > 0 in each interval between the roots of any of the polynomials, and its omega.

    They include points that stand for 0 and for infinity.
    """
    factors = _coprime(polynomials)
    before = ctx.prec
    try:
        for ctx.prec in BITS:
            ends = _intervals(factors)
            apart = pairwise([(fmpq(0), fmpq(0)), *ends])
            if all(one[1] < next_[0] for one, next_ in apart):
                break
        else:
            raise SolverError("roots of different comparisons cannot be told apart")
    finally:
        ctx.prec = before
    if not ends:
        ends = [(fmpq(1), fmpq(1))]
    first, last = ends[0][0], ends[-1][1]
    middle = [_middle(one[1], next_[0]) for one, next_ in pairwise(ends)]
    points = [(x, _root(x)) for x in (first / 2, *middle, last * 2)]
    return [(first / FAR, 0.0), *points, (last * FAR, math.inf)]


def _coprime(polynomials: list[fmpq_poly]) -> list[fmpz_poly]:
    """Polynomials without common roots, which together have the roots of all given ones."""
    found: list[fmpz_poly] = []
    waiting = [p.numer() for p in polynomials if p.degree() > 0]
    while waiting:
        new = waiting.pop()
        for index, old in enumerate(found):
            common = old.gcd(new)
            if common.degree() > 0:
                del found[index]
                waiting += [p for p in (old // common, new // common, common) if p.degree() > 0]
                break
        else:
            found.append(new)
    return found


def _intervals(factors: list[fmpz_poly]) -> list[tuple[fmpq, fmpq]]:
    """Intervals that contain one positive root each, in rising order."""
    roots: list[Any] = [factor.complex_roots() for factor in factors]
    roots = [root for each in roots for root, _ in each]
    real = [root.real for root in roots if root.imag == 0 and not root.real <= 0]
    return sorted((x.lower().fmpq(), x.upper().fmpq()) for x in real)


def _middle(low: fmpq, high: fmpq) -> fmpq:
    """A number between two positive ones: their geometric mean or, if they are close, the mean."""
    mean = exact_rational(_root(low * high))
    return mean if low < mean < high else (low + high) / 2


def _root(square: fmpq) -> float:
    """Square root of an exact number; infinite above the largest double."""
    try:
        return math.sqrt(Fraction(int(square.p), int(square.q)))
    except OverflowError:
        return math.inf
