"""Descent of the largest of several norms over a family, with limits on others.

From a point with the largest norm f and the largest excess c of a limit, a step lowers the larger
of f's change and the excess: until the limits hold they are what falls, and then they stay
(E. Polak, Optimization (1997), section 2.6; P. Apkarian, D. Noll, A. Rondepierre, Mixed
H2/H-infinity control via nonsmooth optimization, SIAM J. Control and Optimization 47 (2008)
1516-1546). A step minimises the largest of the linearised terms plus half a quasi-Newton form in a
trust region.
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
from workbench.synthesis.mu.structured.terms import Curve, Term

MOST_STEPS, TRIAL_STEPS, FINALISTS = 300, 10, 2
"""Most steps, steps of a trial from each of several starts, and starts that go on."""
FIRST_RADIUS, LARGEST_RADIUS, SMALLEST_RADIUS = 0.1, 2.0, 1e-8
"""Trust radius, in units of the parameters."""
ACCEPTED_SHARE, SHRINKING_SHARE, GROWING_SHARE = 0.02, 0.25, 0.7
"""Shares of the promised fall above which a step is taken, below which the radius is halved, and
above which it may grow."""
LOWERED_SHARE = 0.6
"""Values above this share of the largest, or of the limit, are lowered by a step."""
LIMIT_WEIGHT = 10.0
"""Weight of the excess of a limit beside the relative fall of the norm."""
SLACK = 0.1
"""Relative rise of the norm that is let pass, besides the excess, while a limit does not hold: the
last step to the limit would be as short as the excess without it."""
LEAST_PROMISE = 1e-7
"""Relative fall that a step must promise."""
SETTLED_FALL, PATIENCE = 1e-5, 12
"""The descent is settled if the norm falls by less than this share over this number of steps."""
START_SPREAD, DRAWS_PER_START = 0.5, 20
"""Standard deviation of random starts, in units of the parameters, and most draws of each."""


@dataclass(frozen=True, eq=False)
class SearchPoint:
    """Parameters (k,) of a family, and the curve of every term there."""

    family: Family
    terms: Sequence[Term]
    x: RealArray
    curves: Sequence[Curve]

    @cached_property
    def norm(self) -> float:
        """The largest of the norms that are lowered."""
        return max(float(curve[1].max()) for term, curve in self._pairs if term.limit is None)

    @cached_property
    def excess(self) -> float:
        """The largest of the limited norms over its limit, less 1; 0 where all limits hold."""
        over = [
            float(curve[1].max()) / term.limit - 1.0
            for term, curve in self._pairs
            if term.limit is not None
        ]
        return max(0.0, *over) if over else 0.0

    @property
    def rank(self) -> tuple[float, float]:
        """What orders places: the excess, then the norm."""
        return self.excess, self.norm

    @property
    def _slack(self) -> float:
        """By how much the norm may rise where a limit does not hold, relatively."""
        return self.excess + SLACK if self.excess > 0.0 else 0.0

    @property
    def _pairs(self) -> list[tuple[Term, Curve]]:
        return list(zip(self.terms, self.curves, strict=True))

    def merit(self, other: SearchPoint) -> float:
        """How the norm, or the excess of a limit, of another place changes; negative is better."""
        changes = [other.norm / self.norm - 1.0 - self._slack]
        changes += [
            LIMIT_WEIGHT * (float(curve[1].max()) / term.limit - 1.0 - self.excess)
            for term, curve in other._pairs
            if term.limit is not None
        ]
        return max(changes)

    def near(self) -> list[RealArray]:
        """The places of each term whose values are lowered by a step."""
        found = []
        for term, (places, values) in self._pairs:
            top = self.norm if term.limit is None else max(term.limit, float(values.max()))
            found.append(places[values > LOWERED_SHARE * top])
        return found

    def linear(self, x: RealArray, near: Sequence[RealArray]) -> tuple[RealArray, RealArray]:
        """The changes (F,) that `merit` takes the largest of, and their gradients (F, k), at x."""
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
    """Parameters as a place; None where a loop is not stable or not what is asked."""
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
    """The place where a descent from parameters begins, with no direct terms that must not be.

    Raises SolverError where a norm is not finite there.
    """
    terms = terms_of(family)
    value, slope = _direct(terms, x)
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
    """Places, each better than the one before, and why they ended. The clock ends them too."""
    history = [place]
    begun_at, radius, hessian = 0, FIRST_RADIUS, _none(place)
    free = _free(place)
    while len(history) <= steps:
        place = history[-1]
        if place.excess == 0.0 and place.norm <= target:
            return history, "reached the target"
        if context.late:
            return history, "the time ended"
        found = _stepped(place, free, hessian, radius, halfspaces(place.family))
        if isinstance(found, str):
            if begun_at == len(history) - 1:
                return history, found
            begun_at = len(history) - 1
            history[-1] = _rebased(place)  # curvature seen far away may hide the way down
            radius, hessian, free = FIRST_RADIUS, _none(place), _free(history[-1])
            continue
        new, hessian, radius = found
        history.append(new)
        if _settled(history):
            return history, "settled"
    return history, f"stopped after {steps} steps"


def _settled(history: Sequence[SearchPoint]) -> bool:
    """Whether the last steps changed little."""
    if len(history) <= PATIENCE:
        return False
    then, now = history[-1 - PATIENCE], history[-1]
    if then.excess > 0.0:
        return now.excess > then.excess - SETTLED_FALL
    return now.norm > (1 - SETTLED_FALL) * then.norm


def _stepped(
    place: SearchPoint,
    free: RealArray,
    hessian: RealArray,
    radius: float,
    halfspaces: tuple[RealArray, RealArray],
) -> tuple[SearchPoint, RealArray, float] | str:
    """The first step within the trust radius, or a smaller one, that is taken; else why none is."""
    x, near = place.x, place.near()
    if not place.norm:
        return "the norm is zero"
    value, slope = place.linear(x, near)
    sizes = known_units(place.family.units(x), slope, 1.0)
    units = free @ (free.T @ (sizes[:, None] * free))  # parameters (k,) of a step (f,)
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


def _none(place: SearchPoint) -> RealArray:
    """No curvature."""
    size = _free(place).shape[1]
    return np.zeros((size, size))


def _free(place: SearchPoint) -> RealArray:
    """Directions (k, f) of parameters that move no direct term that must be zero."""
    _, slope = _direct(place.terms, place.x)
    return null_space(slope) if slope.any() else np.eye(len(place.x))


def _direct(terms: Sequence[Term], x: RealArray) -> tuple[RealArray, RealArray]:
    """Direct terms (r,) that must be zero, and their gradients (r, k)."""
    values, slopes = zip(*(term.direct(x) for term in terms), strict=True)
    return np.concatenate(values), np.vstack(slopes)


def _rebased(place: SearchPoint) -> SearchPoint:
    """The place in parameters that suit its controller, where the family has a choice."""
    if not isinstance(place.family, Modal):
        return place
    try:
        family, x = place.family.about(place.family.system(place.x))
    except InputError:  # poles that met have no common block
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
    """The descent that ends best: some steps from each start, and more from the best of these.

    Returns its places, why it ended, and the number of its start.
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
    """Random places around one, of finite norms; fewer than `count` where few are."""
    units, found, free = place.family.units(place.x), 0, _free(place)
    for _ in range(DRAWS_PER_START * count):
        move = free @ (free.T @ (START_SPREAD * units * rng.normal(size=place.x.size)))
        member = search_point(place.family, place.terms, place.x + move) if found < count else None
        if member is not None:
            found += 1
            yield member
