"""Where descents of the norm from several starts end.

Starts for an order are also the ends of lower orders with one more state, so that more states are
seldom worse. A few starts go on after the first steps of each. Where their two best ends differ,
there are several minima, and the norm after a few steps does not tell which is the lowest. Then the
other starts go on too, and further random ones, before the search hops and evolves from the best.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

from workbench.executor import Context
from workbench.executor.clock import clocked_by, time_is_up
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.norm import descents
from workbench.synthesis.mu.structured.norm.reduced_plant import reduced_plant
from workbench.synthesis.mu.structured.norm.search import NormPoint, NormSearch

FINALISTS = 3
"""Starts that go on after the first steps of each."""
FURTHER, FURTHER_SHARE = 12, 0.5
"""Further random starts where the best ends differ, and the share of the time left that these and
the other starts may take.
"""
HOPS, ROUNDS = 6, 2
"""Hops from the best point before an evolution, and rounds of hops and evolution."""
GAINED = 1e-3
"""Share of the norm by which a round must lower it for another one to follow."""
AGREED = 1e-4
"""Relative difference of the best two ends of descents below which the search goes no further."""
CLIMBING_SHARE = 0.2
"""Share of the time left that lower orders may take."""
REDUCED_SHARE = 0.7
"""Share of the time left that a search with fewer states of a large plant may take."""
DRAWN_BELOW = 2
"""Random starts of the lowest order from which a search climbs."""

Descent = Callable[[NormPoint, Context], NormPoint]
"""A way down from a point."""


class Ends(NamedTuple):
    """The ``best`` point of a search, norms ``reached`` from all ``starts``."""

    best: NormPoint
    reached: tuple[float, ...]
    starts: int


def bfgs(point: NormPoint, _: Context) -> NormPoint:
    """The end of BFGS."""
    return descents.by_bfgs(point)


def bfgs_along_kinks(point: NormPoint, context: Context) -> NormPoint:
    """BFGS, then sampled gradients."""
    return descents.along_kinks(descents.by_bfgs(point), context.rng)


def hops_and_evolution(point: NormPoint, context: Context) -> NormPoint:
    """The best point of rounds of hops and evolution, while they gain."""
    for _ in range(ROUNDS):
        before = point.value
        point = descents.hopped(point, context.rng, HOPS)
        point = bfgs_along_kinks(descents.by_evolution(point, context.rng), context)
        if not point.value < (1 - GAINED) * before or time_is_up("hops and evolution"):
            break
    return point


def search_ends(
    stated: MuSynthesis,
    context: Context,
    level: float,
    descent: Descent = bfgs,
    on: Descent | None = hops_and_evolution,
) -> Ends:
    """The ends of a search over the controllers of a continuous plant without perturbation.

    Where the best ends differ, the search descends from more starts. From the best end it follows
    sampled gradients and, where the best ends still differ, goes ``on``. With None, the descents
    from the first starts are all. The search ends at a norm of ``level``. Raises SolverError where
    there is no start, and NoStabilisingGainError where none can be.

    For a large plant the search uses a plant with fewer states, and then BFGS descends with the
    large plant from the best controller found. ``reached`` are norms with fewer states then.
    """
    fewer = reduced_plant(stated.plant)
    if fewer is not None:
        search = NormSearch(stated, context)
        own = search.share_of_time(REDUCED_SHARE)
        with clocked_by(own):
            ends = _ends(replace(stated, plant=fewer), own, level, descent, on)
        there = search.about(ends.best.controller)
        if there is not None:
            return ends._replace(best=descents.by_bfgs(there))
    return _ends(stated, context, level, descent, on)


def _ends(
    stated: MuSynthesis, context: Context, level: float, descent: Descent, on: Descent | None
) -> Ends:
    """The ends of a search with the plant as it is."""
    search = NormSearch(stated, context)
    starts = [*search.starts(), *_from_lower_orders(search)]
    ended, others = _descended(starts, context, descent, level)
    more: list[NormPoint] = []
    if on is not None and ended[0].value > level and not _agreed(ended):
        more = descended_further(search, ended, others, level)
        others = others[len(more) :]
        ended = sorted([*ended, *more], key=_value)
    best = ended[0]
    if on is not None and best.value > level:
        best = descents.along_kinks(best, context.rng)
        best = best if best.value <= level or _agreed(ended) else on(best, context)
    reached = sorted(point.value for point in [*ended, *others])
    return Ends(best, tuple(reached), len(reached))


def _from_lower_orders(search: NormSearch) -> list[NormPoint]:
    """The end of a climb from the least order that stabilises, state by state; empty without."""
    if search.order is None or search.mu.start is not None:
        return []
    point: NormPoint | None = None
    with clocked_by(search.share_of_time(CLIMBING_SHARE)):
        for order in range(search.order):
            if point is None:
                point = min(search.drawn(order, DRAWN_BELOW), key=_value, default=None)
            else:
                point = point.grown(order, search.context.rng)
            if time_is_up("lower orders"):
                break
            point = None if point is None else descents.by_bfgs(point)
    return [] if point is None else [point.grown(search.order, search.context.rng)]


def _descended(
    starts: Sequence[NormPoint], context: Context, descent: Descent, level: float
) -> tuple[list[NormPoint], list[NormPoint]]:
    """Where descents from the best starts end, the best first, and the other starts after their
    first steps.
    """
    ahead = []
    for start in starts:
        ahead.append(start if time_is_up("first steps") else descents.first_steps(start))
        context.progress("first steps", len(ahead), len(starts))
    ahead.sort(key=_value)
    ended: list[NormPoint] = []
    for number, point in enumerate(ahead[:FINALISTS], start=1):
        late = time_is_up("descents") or (ended and min(ended, key=_value).value <= level)
        ended.append(point if late else descent(point, context))
        context.record({"start": number, "norm": ended[-1].value})
        context.progress("descents", number, FINALISTS)
    return sorted(ended, key=_value), ahead[FINALISTS:]


def descended_further(
    search: NormSearch, ended: Sequence[NormPoint], others: Sequence[NormPoint], level: float
) -> list[NormPoint]:
    """Where BFGS ends from the other starts and then from further random ones, unless one reaches
    the level. That two ends agree does not stop it: many starts may lead to a poor minimum.
    """
    found: list[NormPoint] = []
    with clocked_by(search.share_of_time(FURTHER_SHARE)):
        for point in chain(others, _drawn_one_by_one(search)):
            reached = min([*ended, *found], key=_value).value <= level
            if reached or time_is_up("further starts"):
                break
            found.append(descents.by_bfgs(point))
            search.context.progress("further starts", len(found), len(others) + FURTHER)
    return found


def _drawn_one_by_one(search: NormSearch) -> Iterator[NormPoint]:
    """Random controllers of the order that stabilise, if an order is searched from random ones."""
    if search.order is not None and search.mu.start is None:
        for _ in range(FURTHER):
            yield from search.drawn(search.order, 1)


def _value(point: NormPoint) -> float:
    return point.value


def _agreed(ended: Sequence[NormPoint]) -> bool:
    """Whether descents from two starts ended at the same norm, the least."""
    return len(ended) > 1 and ended[1].value <= (1 + AGREED) * ended[0].value
