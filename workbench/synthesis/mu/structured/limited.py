"""Descent of the largest of several norms over a family, with limits on others.

At a point with the largest norm f and the largest excess c over a limit, a step lowers the larger
one of f's change and the excess. So the excess decreases until the limits hold, and afterwards they
continue to hold (E. Polak, Optimization (1997), section 2.6; P. Apkarian, D. Noll, A. Rondepierre,
Mixed H2/H-infinity control via nonsmooth optimization, SIAM J. Control and Optimization 47 (2008)
1516-1546). A step minimises the largest of the linearised terms plus half a quasi-Newton form
within a trust region.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from workbench._core.arrays import RealArray
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.synthesis.families.family import Family
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.quasi_newton import updated_hessian
from workbench.synthesis.mu.structured.minimax_step import known_units, minimax_step
from workbench.synthesis.mu.structured.starts.search import DRAWS_PER_START, START_SPREAD
from workbench.synthesis.mu.structured.terms import Curve, Term

MOST_STEPS, TRIAL_STEPS, FINALISTS = 300, 10, 2
"""Largest number of steps, number of steps of a trial from each of several starts, and number of
starts that are continued.
"""
FIRST_RADIUS, LARGEST_RADIUS, SMALLEST_RADIUS = 0.1, 2.0, 1e-8
"""Initial, largest and smallest trust radius, in units of the parameters."""
ACCEPTED_SHARE, SHRINKING_SHARE, GROWING_SHARE = 0.02, 0.25, 0.7
"""Shares of the predicted decrease: a step is accepted above the first one, the radius is halved
below the second one, and it may grow above the third one.
"""
LOWERED_SHARE = 0.6
"""A step considers all values above this share of the largest value, or of the limit."""
LIMIT_WEIGHT = 10.0
"""Weight of the excess over a limit, compared with the relative change of the norm."""
SLACK = 0.1
"""Relative rise of the norm that is allowed, in addition to the excess, while a limit does not
hold. Without it, the last step to the limit would be as short as the excess.
"""
LEAST_PROMISE = 1e-7
"""Least predicted relative decrease of a step."""
SETTLED_FALL, PATIENCE = 1e-5, 12
"""The descent is settled if the norm falls by less than this share over this number of steps."""


@dataclass(frozen=True, eq=False)
class SearchPoint:
    """Parameters (k,) of a family, and the curve of every term at these parameters."""

    family: Family
    terms: Sequence[Term]
    x: RealArray
    curves: Sequence[Curve]

    @cached_property
    def norm(self) -> float:
        """The largest of the norms to be minimised."""
        return max(float(curve[1].max()) for term, curve in self._pairs if term.limit is None)

    @cached_property
    def excess(self) -> float:
        """The largest ratio of a limited norm to its limit, less 1; 0 if all limits hold."""
        over = [
            float(curve[1].max()) / term.limit - 1.0
            for term, curve in self._pairs
            if term.limit is not None
        ]
        return max(0.0, *over) if over else 0.0

    @property
    def rank(self) -> tuple[float, float]:
        """Key for the order of points: first the excess, then the norm."""
        return self.excess, self.norm

    @property
    def _slack(self) -> float:
        """Relative rise of the norm that is allowed while a limit does not hold."""
        return self.excess + SLACK if self.excess > 0.0 else 0.0

    @property
    def _pairs(self) -> list[tuple[Term, Curve]]:
        return list(zip(self.terms, self.curves, strict=True))

    def merit(self, other: SearchPoint) -> float:
        """Largest change of the norm and of the excesses at another point; negative is better."""
        changes = [other.norm / self.norm - 1.0 - self._slack]
        changes += [
            LIMIT_WEIGHT * (float(curve[1].max()) / term.limit - 1.0 - self.excess)
            for term, curve in other._pairs
            if term.limit is not None
        ]
        return max(changes)

    def near(self) -> list[RealArray]:
        """The places (such as frequencies) of each term that a step considers."""
        found = []
        for term, (places, values) in self._pairs:
            top = self.norm if term.limit is None else max(term.limit, float(values.max()))
            found.append(places[values > LOWERED_SHARE * top])
        return found

    def linear(self, x: RealArray, near: Sequence[RealArray]) -> tuple[RealArray, RealArray]:
        """The changes (F,) whose largest is `merit`, and their gradients (F, k), at x."""
        values, slopes = [], []
        for (term, _), places in zip(self._pairs, near, strict=True):
            if not len(places):
                continue
            value, slope = term.linear(x, places)
            if term.limit is None:
                values.append(value / self.norm - 1.0 - self._slack)
                slopes.append(slope / self.norm)
            else:
                values.append(LIMIT_WEIGHT * (value / term.limit - 1.0 - self.excess))
                slopes.append(LIMIT_WEIGHT / term.limit * slope)
        return np.concatenate(values), np.vstack(slopes)


def search_point(family: Family, terms: Sequence[Term], x: RealArray) -> SearchPoint | None:
    """Parameters as a point; None if a loop is unstable or the controller does not meet the
    demands.
    """
    curves = []
    for term in terms:
        curve = term.curve(x)
        if curve is None:
            return None
        curves.append(curve)
    return SearchPoint(family, terms, x, curves)


def first_point(
    family: Family, terms_of: Callable[[Family], Sequence[Term]], x: RealArray
) -> SearchPoint:
    """The point where a descent from parameters begins; direct terms that must be zero are removed.

    Raises SolverError if a norm is not finite there.
    """
    terms = terms_of(family)
    value, slope = _direct_terms(terms, x)
    if value.any():
        x = x - np.linalg.lstsq(slope, value, rcond=None)[0]
    place = search_point(family, terms, x)
    if place is None:
        raise SolverError("no start was found whose loops are stable and have finite norms")
    return place


def limited_descent(
    place: SearchPoint,
    halfspaces: Callable[[Family], tuple[RealArray, RealArray]],
    context: Context,
    target: float = 0.0,
    steps: int = MOST_STEPS,
) -> tuple[list[SearchPoint], str]:
    """Points, each better than the one before, and the reason for the end. The time limit also ends
    them.
    """
    history = [place]
    begun_at, radius, hessian = 0, FIRST_RADIUS, _no_curvature(place)
    free = _free_directions(place)
    while len(history) <= steps:
        place = history[-1]
        if place.excess == 0.0 and place.norm <= target:
            return history, "reached the target"
        if context.late:
            return history, "the time ended"
        found = _accepted_step(place, free, hessian, radius, halfspaces(place.family))
        if isinstance(found, str):
            if begun_at == len(history) - 1:
                return history, found
            begun_at = len(history) - 1
            history[-1] = _in_suitable_parameters(
                place
            )  # curvature from distant points may hide a descent
            radius, hessian, free = (
                FIRST_RADIUS,
                _no_curvature(place),
                _free_directions(history[-1]),
            )
            continue
        new, hessian, radius = found
        history.append(new)
        if _has_settled(history):
            return history, "settled"
    return history, f"stopped after {steps} steps"


def _has_settled(history: Sequence[SearchPoint]) -> bool:
    """Whether the last steps changed norm or excess only little."""
    if len(history) <= PATIENCE:
        return False
    then, now = history[-1 - PATIENCE], history[-1]
    if then.excess > 0.0:
        return now.excess > then.excess - SETTLED_FALL
    return now.norm > (1 - SETTLED_FALL) * then.norm


def _accepted_step(
    place: SearchPoint,
    free: RealArray,
    hessian: RealArray,
    radius: float,
    halfspaces: tuple[RealArray, RealArray],
) -> tuple[SearchPoint, RealArray, float] | str:
    """The first accepted step within the trust radius or a smaller one; a message if there is
    none.
    """
    x, near = place.x, place.near()
    if not place.norm:
        return "the norm is zero"
    value, slope = place.linear(x, near)
    sizes = known_units(place.family.units(x), slope, 1.0)
    units = free @ (free.T @ (sizes[:, None] * free))  # maps a step (f,) to parameters (k,)
    inner = free.T @ units
    rows, sides = halfspaces
    room = (rows @ units, sides - rows @ x) if len(rows) else None
    scaled = inner.T @ hessian @ inner
    while radius > SMALLEST_RADIUS:
        step, level, weights = minimax_step(scaled, slope @ units, value, radius, room)
        length = float(np.abs(step).max())
        if level > -LEAST_PROMISE:
            return "no step promises less"
        trial = search_point(place.family, place.terms, x + units @ step)
        change = math.inf if trial is None else place.merit(trial)
        if trial is not None and change < ACCEPTED_SHARE * level:
            turned = (place.linear(trial.x, near)[1] - slope).T @ weights
            hessian = updated_hessian(hessian, inner @ step, free.T @ turned)
            if change < GROWING_SHARE * level and length > 0.8 * radius:
                radius = min(2.5 * radius, LARGEST_RADIUS)
            elif change > SHRINKING_SHARE * level:
                radius *= 0.5
            return trial, hessian, radius
        radius = 0.35 * min(radius, length)
    return "no step lowers the norm"


def _no_curvature(place: SearchPoint) -> RealArray:
    """A Hessian without curvature."""
    size = _free_directions(place).shape[1]
    return np.zeros((size, size))


def _free_directions(place: SearchPoint) -> RealArray:
    """Directions (k, f) of the parameters that keep direct terms zero that must be zero."""
    _, slope = _direct_terms(place.terms, place.x)
    return null_space(slope) if slope.any() else np.eye(len(place.x))


def _direct_terms(terms: Sequence[Term], x: RealArray) -> tuple[RealArray, RealArray]:
    """Direct terms (r,) that must be zero, and their gradients (r, k)."""
    values, slopes = zip(*(term.direct(x) for term in terms), strict=True)
    return np.concatenate(values), np.vstack(slopes)


def _in_suitable_parameters(place: SearchPoint) -> SearchPoint:
    """The point in parameters that suit its controller, if the family has a choice of
    parameters.
    """
    if not isinstance(place.family, Modal):
        return place
    try:
        family, x = place.family.about(place.family.system(place.x))
    except InputError:  # equal real poles cannot form a block
        return place
    new = search_point(family, [term.in_family(family) for term in place.terms], x)
    return place if new is None or new.rank > place.rank else new


# --- from several starts ----------------------------------------------------------------------


def best_descent(
    starts: Sequence[SearchPoint],
    halfspaces: Callable[[Family], tuple[RealArray, RealArray]],
    context: Context,
    target: float = 0.0,
) -> tuple[list[SearchPoint], str, int]:
    """The descent with the best end: a few steps from each start, and more from the best of these.

    Returns its points, the reason for its end, and the index of its start.
    """
    tried: list[tuple[list[SearchPoint], str, int]] = []
    several = len(starts) > 1
    for number, start in enumerate(context.track(starts, "starts")):
        steps = TRIAL_STEPS if several else MOST_STEPS
        tried.append((*limited_descent(start, halfspaces, context, target, steps), number))
        if context.late:
            break
    tried.sort(key=lambda one: one[0][-1].rank)
    if not several:
        return tried[0]
    ended = []
    for history, _, number in context.track(tried[:FINALISTS], "further steps"):
        more, said = limited_descent(history[-1], halfspaces, context, target)
        ended.append((history + more[1:], said, number))
    return min(ended, key=lambda one: one[0][-1].rank)


def drawn_points(place: SearchPoint, count: int, rng: np.random.Generator) -> Iterator[SearchPoint]:
    """Random points around one with finite norms; fewer than `count` if few are found."""
    units, found, free = place.family.units(place.x), 0, _free_directions(place)
    for _ in range(DRAWS_PER_START * count):
        move = free @ (free.T @ (START_SPREAD * units * rng.normal(size=place.x.size)))
        member = search_point(place.family, place.terms, place.x + move) if found < count else None
        if member is not None:
            found += 1
            yield member
