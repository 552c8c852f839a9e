"""The set of T = L / (1 + L) for which mu is at most a level at a frequency.

With the weights of `LoopWeights`, A = |W_c T| + |(W_p (1 - T), W_u T / G)|, and v = W_r T, mu is at
most a level l where A is at most the distance of 0 from the segment between l - v and l + v. For T
= r exp(j psi), where beta is the angle of v,

    A(r, psi) <= D(r),    D(r)^2 = l^2 sin(beta)^2 + max(0, l |cos(beta)| - r |W_r|)^2.

A decreases with cos(psi), and D decreases with |cos(beta)| and |W_r|. D is convex in r. So over a
range of r it lies below the line through its values at both ends. With this line the inequality is
quadratic, and its roots narrow the range; this is repeated. On cones of psi the range of r bounds
Re(T h) from above. The cones that may contain the largest value are halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import ComplexArray, RealArray
from workbench.synthesis.limits.intervals import ComplexInterval, Interval, down, up
from workbench.synthesis.limits.loop_functions import LeastWeights

CONES = 16
"""Number of cones of psi at the start; it is even, so that psi = 0 is the end of two cones."""
HALVINGS = 14
"""Largest number of halvings of a cone."""
RAYS = 96
"""Number of rays on which the search takes points of the sets."""
NARROWINGS = 4
"""Number of times a range of r is narrowed. More would be sharper where |W_r| is large, but dear.
"""
WIDENED = 1 + 1e-9
"""Factor that enlarges the range of angles of T, so that the rounded sine is not too small."""


@dataclass(frozen=True, eq=False)
class Cone:
    """Directions of T, anticlockwise from ``first`` to ``last`` (N,), less than pi apart.

    Both are complex numbers of any size.
    """

    first: ComplexArray
    last: ComplexArray


def allowed_radii(weights: LeastWeights, level: float, cone: Cone) -> tuple[RealArray, RealArray]:
    """Lower and upper bounds (N,) on |T| in a cone with mu at most a level; NaN where no T is
    allowed.

    Bounds are rounded outward. psi = 0 must not lie in the interior of a cone.
    """
    ends = [_unit(end) for end in (cone.first, cone.last)]
    cosine = np.maximum(ends[0].real.high, ends[1].real.high)
    kappa = np.minimum(_least_cosine(weights, ends), 1.0)
    W_p, W_u, W_c = (
        Interval.of(each) for each in (weights.performance, weights.control, weights.circular)
    )
    across = Interval.of(level).squared() * (1.0 - Interval.of(kappa).squared())

    def distance(r: RealArray) -> RealArray:
        left = np.maximum((Interval.of(level) * kappa - Interval.of(r) * weights.real).high, 0.0)
        return (across + Interval.of(left).squared()).root().high

    low, high = np.fmax((1.0 - level / W_p).low, 0.0), largest_modulus(weights, level)
    empty = np.zeros(low.shape, bool)
    whole, square = W_p.squared() + W_u.squared(), W_p.squared()
    for _ in range(NARROWINGS):
        at = distance(low), distance(high)
        fall = np.where(high > low, np.fmax((at[0] - at[1]) / (high - low), 0.0), 0.0)
        right = Interval.of(np.maximum(up(at[0] + up(fall * low)), up(at[1] + up(fall * high))))
        # slope r + sqrt(whole r^2 - 2 W_p^2 cosine r + W_p^2) <= right
        slope = W_c + fall
        middle, left = square * cosine - right * slope, whole - slope.squared()
        rest = square - right.squared()
        discriminant = middle.squared() - left * rest
        root = discriminant.root()
        empty |= (left.low > 0.0) & (discriminant.high < 0.0)
        empty |= (rest.low > 0.0) & ((middle + root).high < 0.0)
        bounds = [
            np.where(left.low > 0.0, ((middle + root) / left).high, np.inf),
            np.where(
                (left.low > 0.0) & ((root - middle).low > 0.0),
                (-rest / (root - middle)).high,
                np.inf,
            ),
            (right / slope).high,
        ]
        high = np.fmin.reduce([high, *bounds])
        positive = (rest.low > 0.0) & ((middle + root).low > 0.0)
        low = np.fmax(low, np.where(positive, (rest / (middle + root)).low, 0.0))
        empty |= low > high
    return np.where(empty, np.nan, low), np.where(empty, np.nan, high)


@np.errstate(all="ignore")
def largest_projections(
    weights: LeastWeights, level: float, h: ComplexArray, slack: RealArray
) -> RealArray:
    """Upper bounds (F, H) on Re(T h) over all T with mu at most a level; -inf where no T is
    allowed.

    Parameters
    ----------
    weights
        Weights at frequencies or over cells (F,).
    h
        Complex numbers (F, H).
    slack
        Allowed excess of a bound over the exact value (F,), relative to |h| and to the radius of
        the set for W_p and W_u / G alone.
    """
    center, squared = _nominal_disc(weights, level)
    size = (Interval.of(h.real).squared() + Interval.of(h.imag).squared()).root()
    bound = (center.columns * h.real + squared.root().columns * size).high
    bound = np.where(np.isnan(bound), np.inf, bound)
    bound[squared.high < 0.0] = -np.inf
    some = np.flatnonzero(bound.max(axis=1) > -np.inf)
    if not some.size or not (weights.circular.any() or weights.real.any()):
        return bound
    room = size.high * (slack * np.sqrt(np.fmax(squared.high, 0.0)))[:, None]
    settled = np.full(bound.shape, -np.inf)
    k, cone = _first_cones(weights, level, some)
    for halving in range(HALVINGS + 1):
        most = _projections(weights.at(k), level, cone, h[k])
        reached = _values_on_middle_rays(weights, level, k, cone, h, most)
        undecided = (most > np.fmax(reached + room, settled)[k]).any(axis=1)
        if halving == HALVINGS:
            undecided[:] = False
        np.fmax.at(settled, k[~undecided], most[~undecided])
        if not undecided.any():
            break
        k, cone = np.tile(k[undecided], 2), _halves(cone, undecided)
    return np.fmin(bound, settled)


@np.errstate(all="ignore")
def largest_modulus(weights: LeastWeights, level: float) -> RealArray:
    """Upper bounds (F,) on |T| over all T with mu at most a level."""
    W_p, others = Interval.of(weights.performance), Interval.of(weights.circular) + weights.control
    return np.fmin((1.0 + level / W_p).high, (level / others).high)


@np.errstate(all="ignore")
def allowed_points(weights: LeastWeights, level: float) -> ComplexArray:
    """The smallest and the largest allowed T on each ray (F, 2 RAYS); NaN where no T is allowed."""
    psi = _largest_angle(weights, level)[:, None] * np.linspace(-1.0, 1.0, RAYS)
    rays, k = np.exp(1j * psi).ravel(), np.repeat(np.arange(len(psi)), RAYS)
    radii = allowed_radii(weights.at(k), level, Cone(rays, rays))
    return np.concatenate([(r * rays).reshape(psi.shape) for r in radii], axis=1)


def _nominal_disc(weights: LeastWeights, level: float) -> tuple[Interval, Interval]:
    """Centre and squared radius of the disc |(W_p (1 - T), W_u T / G)| <= level."""
    W_p, W_u = (Interval.of(each).squared() for each in (weights.performance, weights.control))
    whole = W_p + W_u
    return W_p / whole, (Interval.of(level).squared() - W_p * W_u / whole) / whole


def _first_cones(
    weights: LeastWeights, level: float, cells: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Cone]:
    """Indices of the cells and, for each of these cells, CONES cones that contain its allowed T."""
    psi = _largest_angle(weights, level)[cells, None] * np.linspace(-1.0, 1.0, CONES + 1)
    corners = np.where(np.abs(psi) == np.pi, -1.0, np.cos(psi) + 1j * np.sin(psi))
    return np.repeat(cells, CONES), Cone(corners[:, :-1].ravel(), corners[:, 1:].ravel())


def _projections(weights: LeastWeights, level: float, cone: Cone, h: ComplexArray) -> RealArray:
    """Upper bounds (N, H) on Re(T h) in cones (N,), with h (N, H); -inf where no T is allowed."""
    low, high = allowed_radii(weights, level, cone)
    target = ComplexInterval(Interval.of(h.real), Interval.of(h.imag))
    first, last = (_unit(end[:, None]) * target for end in (cone.first, cone.last))
    # For directions u in the cone, the largest Re(u h) is |h| if u h can be real and positive.
    within = (first.imag.low <= 0.0) & (last.imag.high >= 0.0)
    along = np.maximum(first.real.high, last.real.high)
    along = np.where(within, np.maximum(along, target.size().high), along)
    most = np.maximum(up(along * high[:, None]), up(along * low[:, None]))
    most = np.where(np.isnan(most), np.inf, most)
    most[np.isnan(high)] = -np.inf
    return most


def _values_on_middle_rays(
    weights: LeastWeights,
    level: float,
    k: NDArray[np.intp],
    cone: Cone,
    h: ComplexArray,
    most: RealArray,
) -> RealArray:
    """Re(T h) (F, H) on the middle ray of the cone with the largest bound, for each cell."""
    found = np.full(h.shape, -np.inf)
    for each in most.T:
        order = np.lexsort((each, k))
        best = order[np.append(k[order][1:] != k[order][:-1], True)]
        middle = _middle(Cone(cone.first[best], cone.last[best]))
        at = k[best]
        there = _projections(weights.at(at), level, Cone(middle, middle), h[at])
        found[at] = np.fmax(found[at], there)
    return found


def _middle(cone: Cone) -> ComplexArray:
    found: ComplexArray = cone.first / np.abs(cone.first) + cone.last / np.abs(cone.last)
    return found


def _halves(cone: Cone, chosen: NDArray[np.bool_]) -> Cone:
    """Both halves of the chosen cones, one after the other."""
    first, last = cone.first[chosen], cone.last[chosen]
    middle = _middle(Cone(first, last))
    return Cone(np.append(first, middle), np.append(middle, last))


def _largest_angle(weights: LeastWeights, level: float) -> RealArray:
    """Largest angles |psi| of T (F,) for which |1 - T| <= level / W_p is possible."""
    share = (level / Interval.of(weights.performance)).high
    psi = np.arcsin(np.minimum(share, 1.0)) * WIDENED
    sine = _unit(np.cos(psi) + 1j * np.sin(psi)).imag.low
    return np.where((share < 1.0) & (sine >= share), psi, np.pi)


def _unit(direction: ComplexArray) -> ComplexInterval:
    box = ComplexInterval(Interval.of(direction.real), Interval.of(direction.imag))
    size = box.size()
    return ComplexInterval(box.real / size, box.imag / size)


def _least_cosine(weights: LeastWeights, ends: list[ComplexInterval]) -> RealArray:
    """A lower bound on |cos(beta)| over a cone; 0 where the cosine may change its sign."""
    cosines = [(end * weights.along).real for end in ends]
    above = np.minimum(cosines[0].low, cosines[1].low)
    below = np.minimum(-cosines[0].high, -cosines[1].high)
    return np.fmax(down(np.fmax(above, below) - weights.turned), 0.0)
