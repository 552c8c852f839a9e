"""Search among many local optima for the model of least inflation over the raw sets.

Each generation starts from the best models that differ: near them, and with a pair of roots of the
nominal or of a weight moved to a frequency where the sets are too large.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor import Context
from workbench.uncertainty.covers.cover import RADIUS_ROUNDING, UncertaintyCover
from workbench.uncertainty.covers.joint.moved_pairs import with_moved_pair
from workbench.uncertainty.covers.joint.search import FoundModel, smallest_model
from workbench.uncertainty.covers.sizes.inflation import extent, plant_sizes
from workbench.uncertainty.covers.weights import needed_radius

GENERATIONS, KEPT = 6, 5
"""Number of generations, and of models that each one starts from. Most searches end by `PATIENCE`.
With half of them inflations may be larger; double takes up to twice as long.
"""
PATIENCE = 3
"""The search ends after this many generations that improve nothing. A generation improves by
chance, so one or two idle ones say little. With half of them the search ends earlier, at a larger
inflation; double takes longer.
"""
SEARCH_POWERS = (8, 16, 32)
"""Powers of the norms in the search. Each norm is nearer to the largest value and harder to
descend. Half of all minds peaks less; double of all ends at worse local optima.
"""
SEARCH_STEPS = 100
"""Largest number of quasi-Newton steps with each power. Half stops searches before their optimum;
double costs time, since `ALIKE` asks for no more.
"""
SPREADS = (0.5, 0.2)
"""Standard deviations of random starts near a model, in units of the parameters. The larger one
leaves a local optimum, the smaller one tries its neighbours. Half or double: starts mostly lead
back, or are no better than random ones.
"""
ALIKE = 6e-3
"""Relative difference of inflations below which two models count as alike. The search is stopped
before its optimum, so two runs to one optimum differ a little. With half of it copies may fill the
population; with double of it optima 1 % apart count as one.
"""
PLACE_POWER = 4
"""Power of the inflation at a frequency to which the chance of a moved pair is proportional. With
half of it pairs move to places that do not matter more often; with double of it nearly all go to
one place.
"""


def least_inflations(
    program: UncertaintyCover, starts: Iterable[FoundModel], context: Context
) -> list[FoundModel]:
    """Models by increasing inflation, each of which differs from those before."""

    def searched(start: FoundModel, spread: float) -> FoundModel:
        """The model of least inflation near a start."""
        powers, steps = SEARCH_POWERS, SEARCH_STEPS
        return smallest_model(program, start, powers, context, spread, "inflation", steps)

    found = [searched(start, 0.0) for start in starts]
    least, idle = np.inf, 0
    for _ in context.track(range(GENERATIONS), "generations"):
        best = different_models(found, ALIKE)[:KEPT]
        idle = idle + 1 if best and best[0].size > least * (1 - ALIKE) else 0
        if not best or idle == PATIENCE:
            break
        least = best[0].size
        found = best + [
            searched(start, spread)
            for model in best
            for start, spread in _near(program, model, context.rng)
        ]
    return different_models(found, ALIKE)


def different_models(found: Iterable[FoundModel], alike: float) -> list[FoundModel]:
    """Models by increasing finite size that differ by more than a relative difference."""
    kept: list[FoundModel] = []
    finite = (model for model in found if math.isfinite(model.size))
    for model in sorted(finite, key=lambda model: model.size):
        if not kept or model.size > kept[-1].size * (1 + alike):
            kept.append(model)
    return kept


def _near(
    program: UncertaintyCover, model: FoundModel, rng: np.random.Generator
) -> Iterator[tuple[FoundModel, float]]:
    """Starts near a model, with the standard deviation of their parameters."""
    for spread in SPREADS:
        yield model, spread
    omega = program.responses.axis
    weight = _inflation(program, model) ** PLACE_POWER
    for name, part in model.parts(fixed=program.nominal is not None).items():
        wanted = float(rng.choice(omega, p=weight / weight.sum()))
        moved = with_moved_pair(part, omega, wanted, rng)
        if moved is not None:
            changed: dict[str, Any] = {name: moved}
            yield model._replace(**changed), 0.0


def _inflation(program: UncertaintyCover, model: FoundModel) -> RealArray:
    """Inflation (F,) of the sets that need least W_c, over the raw ones with free centres."""
    omega = program.responses.axis
    end = None if model.W_r is None else model.W_r.response(omega)
    size = needed_radius(program.deviations_from(model.nominal, program.points), end)
    if end is not None:
        size = size + np.abs(end)
    if program.form == "multiplicative":
        size = size * np.abs(model.nominal.response(omega))
    rounding = RADIUS_ROUNDING * plant_sizes(program.points)  # plants may be alike at a frequency
    return np.asarray(size / np.maximum(extent(program.raw_sets), rounding))
