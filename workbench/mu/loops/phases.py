"""Quasi-polynomials at infinite frequency, where the phases of the dead times are free.

Along the axis, f(s) / s^n = sum c_T exp(-j omega T) + O(1 / omega). Delays that are not whole
multiples of one common delay turn independently, so that the values at high frequencies fill those
of a torus of phases; whole multiples of one delay repeat with its period, a torus of one phase. The
torus is cut into boxes. A box is done when the function moves on it by less than half of its
distance from what is to be excluded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations, product

import numpy as np

from workbench._core.arrays import Array, BoolArray, ComplexArray, RealArray
from workbench.mu.loops.quasi_polynomials import QuasiPolynomial

LARGEST_MULTIPLE = 200
"""Delays up to this multiple of one common delay count as periodic; others turn independently. With
double of it the curve of one phase fills the torus more densely than its bounds can tell.
"""
MOST_BOXES = 200_000
"""Largest number of boxes at a time; a bound that needs more is not proven. With double of it a
bound of four free phases becomes about a third closer.
"""
NARROWEST = 2.0**-40
"""Half of the side [rad] of the smallest box. What they leave open is touched, up to rounding.
Half or double changes nothing but the last few boxes of a bound that is not proven.
"""
ROUNDING = 1e-12
"""Rounding of a sum in doubles, relative to the sizes of its terms. It has room for thousands of
roundings. Half or double changes nothing.
"""
STARTS = 1000
"""Number of points of the torus from which the largest crossing is searched. With three phases they
are ten a side. With half of them a narrow crossing may be overlooked; double costs time.
"""
NEWTON_STEPS = 12
"""Number of steps from each of these points to a crossing. Newton's method doubles the digits with
each. With half of them fewer points arrive; with double all do that ever do.
"""
FIRST_TOLERANCES = (0.3, 0.1, 0.01, 1e-3)
"""Tolerances that are tried first: with many phases a close bound takes too many boxes. Half or
double of them gives another bound where the closest one is not proven.
"""
BEST = 6
"""Number of crossings that are improved. The largest ones lie in one valley. With half of them
the largest may be missed; double costs time.
"""


def multiples_of(
    delays: Sequence[Fraction], parts: Sequence[Fraction]
) -> dict[Fraction, tuple[int, ...]]:
    """Each delay [s] as whole multiples of delays that turn independently.

    ``delays`` are sums of some of the ``parts``, the dead times of the loop.
    """
    late = [T for T in delays if T]
    if not late:
        return dict.fromkeys(delays, ())
    denominator = math.lcm(*(T.denominator for T in late))
    base = Fraction(math.gcd(*(int(T * denominator) for T in late)), denominator)
    if max(late) <= LARGEST_MULTIPLE * base:
        return {T: (int(T / base),) for T in delays}
    every, sums = sorted(set(parts)), dict[Fraction, tuple[int, ...]]()
    for k in range(len(parts) + 1):
        for chosen in combinations(parts, k):  # the fewest parts of a sum are taken
            total = sum(chosen, Fraction(0))
            sums.setdefault(total, tuple(chosen.count(one) for one in every))
    # Parts that occur in the same terms only turn together.
    columns = dict.fromkeys(zip(*(sums[T] for T in delays), strict=True))
    kept = [column for column in columns if any(column)]
    return dict(zip(delays, zip(*kept, strict=True), strict=True))


@dataclass(frozen=True, eq=False)
class LimitSum:
    """sum c exp(-j m . phases), the limit of a quasi-polynomial over a power of s.

    Unlike a `QuasiPolynomial`, it is at infinite frequency, and has free phases.

    ``factors`` (t,); ``multiples`` (t, d).
    """

    factors: RealArray
    multiples: RealArray

    @classmethod
    def of(
        cls, f: QuasiPolynomial, order: int, multiples: dict[Fraction, tuple[int, ...]]
    ) -> LimitSum:
        """The limit of f(s) / s^order."""
        terms = f.leading(order)
        free = len(next(iter(multiples.values())))
        rows = np.array([multiples[T] for T in terms], dtype=float).reshape(len(terms), free)
        return cls(np.array(list(terms.values()), dtype=float), rows)

    def at(self, phases: RealArray) -> ComplexArray:
        """Values (M,) at phases (M, d) [rad]."""
        found: ComplexArray = self._turned(phases) @ self.factors
        return found

    def slopes(self, phases: RealArray) -> ComplexArray:
        """Derivatives (M, d) over the phases."""
        found: ComplexArray = self._turned(phases) @ (-1j * self.factors[:, None] * self.multiples)
        return found

    @cached_property
    def size(self) -> float:
        """The sum of the sizes of the terms."""
        return float(np.abs(self.factors).sum())

    def moved(self, half: RealArray, power: int = 1) -> float:
        """The sum of |c| |m . step|^power for the largest step in a box with these half sides."""
        return float(np.abs(self.factors) @ (np.abs(self.multiples) @ half) ** power)

    def _turned(self, phases: RealArray) -> ComplexArray:
        turned: ComplexArray = np.exp(-1j * (phases @ self.multiples.T))
        return turned


@dataclass(frozen=True, eq=False)
class LimitPair:
    """Two quasi-polynomials f and g at infinite frequency, with the same free phases.

    Unlike a `LimitSum`, it is of a pair.
    """

    f: LimitSum
    g: LimitSum

    @classmethod
    def of(
        cls, f: QuasiPolynomial, g: QuasiPolynomial, order: int, parts: Sequence[Fraction]
    ) -> LimitPair:
        """The limits of both over s^order; ``parts`` [s] are the dead times of the loop."""
        delays = sorted({T for one in (f, g) for T in one.leading(order)} | {Fraction(0)})
        multiples = multiples_of(delays, parts)
        return cls(LimitSum.of(f, order, multiples), LimitSum.of(g, order, multiples))

    @property
    def swapped(self) -> LimitPair:
        return LimitPair(self.g, self.f)

    def least_size(self, level: float) -> float:
        """A lower bound of |f + x g| for all phases and all x from a level to 1.

        It is at least half of the least value, or 0 where that takes too many boxes.
        """
        least, (centres, half) = math.inf, self._first_boxes()
        slack = ROUNDING * (self.f.size + self.g.size)
        while len(centres):
            f, g = self.f.at(centres), self.g.at(centres)
            near = distance_to_segment(f + level * g, f + g)
            moved = self.f.moved(half) + self.g.moved(half) + slack
            done = near > 2.0 * moved
            least = min(least, float(near[done].min(initial=math.inf)) / 2.0)
            if not self._may_halve(done, half):
                return 0.0
            centres, half = self._halved(centres[~done], half)
        return least

    def largest_crossing(self) -> float:
        """The largest x in (0, 1) found with f + x g = 0 at some phases; 0 if none is found."""
        from scipy.optimize import minimize

        d = self.f.multiples.shape[1]
        if not self.f.size:
            return 0.0
        points = np.random.default_rng(0).uniform(-np.pi, np.pi, (STARTS, d))
        with np.errstate(divide="ignore", invalid="ignore"):
            x = np.nan_to_num(np.clip(-(self.f.at(points) / self.g.at(points)).real, 0.0, 1.0))
        for _ in range(NEWTON_STEPS):
            step = np.clip(self._to_crossing(points, x), -1.0, 1.0)
            points, x = points + step[:, :d], x + step[:, d]
        left = np.abs(self.f.at(points) + x * self.g.at(points))
        kept = (left <= ROUNDING * (self.f.size + self.g.size)) & (x > 0.0) & (x < 1.0)
        best = np.flatnonzero(kept)[np.argsort(-x[kept])[:BEST]]
        found = float(x[best].max(initial=0.0))

        def rest(v: RealArray) -> RealArray:
            value = self.f.at(v[None, :d]) + v[d] * self.g.at(v[None, :d])
            return np.concatenate([value.real, value.imag])

        for k in best if d > 1 else []:
            start = np.append(points[k], x[k])
            better = minimize(
                lambda v: -v[d], start, method="SLSQP", constraints={"type": "eq", "fun": rest},
                options={"ftol": 1e-14},
            )  # fmt: skip
            reached = float(np.abs(rest(better.x)).max()) <= 1e-9 * self.f.size
            if reached and found < better.x[d] < 1.0:
                found = float(better.x[d])
        return found

    def least_ratio(self, tolerance: float) -> tuple[float, float]:
        """A lower bound of |f / g| for all phases, and the least value found.

        The bound is farther below it than the tolerance, or 0, where it takes too many boxes.
        """
        from scipy.optimize import minimize

        d = self.f.multiples.shape[1]

        def ratio(points: RealArray) -> RealArray:
            with np.errstate(divide="ignore"):
                return np.abs(self.f.at(points)) / np.abs(self.g.at(points))

        points = np.random.default_rng(0).uniform(-np.pi, np.pi, (STARTS, d))
        points[0] = 0.0
        values = ratio(points)
        found = float(values.min())
        for k in np.argsort(values)[:BEST] if d else []:
            if math.isfinite(values[k]):
                found = min(found, float(minimize(lambda v: ratio(v[None]).item(), points[k]).fun))
        if not math.isfinite(found):
            return math.inf, math.inf
        proven = 0.0
        for share in (*(one for one in FIRST_TOLERANCES if one > tolerance), tolerance):
            if not self._above(found * (1.0 - share)):
                break
            proven = found * (1.0 - share)
        return proven, found

    def _above(self, ratio: float) -> bool:
        """Whether |f| is proven to be above |g| times a number for all phases.

        |f|^2 - ratio^2 |g|^2 is bounded on each box by its value and slope at the centre.
        """
        square, (centres, half) = ratio**2, self._first_boxes()
        slack = ROUNDING * (self.f.size**2 + square * self.g.size**2)
        while len(centres):
            f, g = self.f.at(centres), self.g.at(centres)
            value = np.abs(f) ** 2 - square * np.abs(g) ** 2
            rates = f.conj()[:, None] * self.f.slopes(centres)
            rates = rates - square * g.conj()[:, None] * self.g.slopes(centres)
            second_f, second_g = self.f.moved(half, 2) / 2.0, self.g.moved(half, 2) / 2.0
            bent = 2.0 * np.abs(f) * second_f
            bent = bent + square * (
                2.0 * np.abs(g) * second_g + (self.g.moved(half) + second_g) ** 2
            )
            done = value > 2.0 * np.abs(rates.real) @ half + bent + slack
            if not self._may_halve(done, half):
                return False
            centres, half = self._halved(centres[~done], half)
        return True

    def _to_crossing(self, points: RealArray, x: RealArray) -> RealArray:
        """The least step (M, d + 1) of the phases and x to a zero of f + x g, to first order."""
        value = self.f.at(points) + x * self.g.at(points)
        slopes = self.f.slopes(points) + x[:, None] * self.g.slopes(points)
        every = np.concatenate([slopes, self.g.at(points)[:, None]], axis=1)
        J = np.stack([every.real, every.imag], axis=1)
        left = np.stack([value.real, value.imag], axis=1)[..., None]
        step: Array = -(np.linalg.pinv(J) @ left)[..., 0]
        return step

    def _first_boxes(self) -> tuple[RealArray, RealArray]:
        """Centres (M, d) and half of the sides (d,) of boxes; opposite phases give conjugates."""
        d = self.f.multiples.shape[1]
        every = list(product(*[(0.5,), *[(-0.5, 0.5)] * (d - 1)][:d]))
        centres = np.array(every, dtype=float).reshape(len(every), d) * math.pi
        return centres, np.full(d, math.pi / 2)

    @staticmethod
    def _may_halve(done: BoolArray, half: RealArray) -> bool:
        """Whether boxes that are not done, if there are any, are few and wide enough to be cut."""
        left = int((~done).sum())
        return not left or (left <= MOST_BOXES and float(half.max(initial=0.0)) >= NARROWEST)

    def _halved(self, centres: RealArray, half: RealArray) -> tuple[RealArray, RealArray]:
        """The boxes cut in two along the phases that move the values most."""
        influence = half * sum(
            np.abs(one.factors) @ np.abs(one.multiples) for one in (self.f, self.g)
        )
        cut = influence >= influence.max(initial=0.0) / 2.0
        signs = np.array(list(product(*[(-0.5, 0.5) if one else (0.0,) for one in cut])))
        shape = len(centres) * len(signs), centres.shape[1]
        moved: RealArray = (centres[:, None, :] + signs * half).reshape(shape)
        return moved, np.where(cut, half / 2.0, half)


def distance_to_segment(start: ComplexArray, end: ComplexArray) -> RealArray:
    """The distance of 0 from the segments between two numbers each."""
    along = end - start
    square = np.abs(along) ** 2
    share = np.divide(
        -(start * along.conj()).real, square, out=np.zeros_like(square), where=square > 0.0
    )
    found: RealArray = np.abs(start + np.clip(share, 0.0, 1.0) * along)
    return found
