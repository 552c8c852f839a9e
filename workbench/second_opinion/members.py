"""Random members of a set, by the distributions of their parameters, and how many are good."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy import stats

from workbench._core.arrays import RealArray
from workbench.certificate import Check
from workbench.executor.effort import tries
from workbench.second_opinion import SEED
from workbench.second_opinion.powers import growth
from workbench.second_opinion.responses import plain_response, tried_frequencies

MEMBERS = 300
"""Number of members that are drawn."""
LEVEL = 1e-9
"""Probability of a contradiction by chance."""
CLOSE_SHARE = 1e-3
"""A member is left undecided if its sampled gain is this close to the level, relative."""
BISECTIONS = 60
"""Number of bisections of a range in the search for a value: more than doubles can resolve."""
TRIES = 10_000
"""A distribution counts as having no probability in its range after this many draws outside."""


def drawn_values(
    ranges: Mapping[str, tuple[float, float]], laws: Mapping[str, Any]
) -> dict[str, RealArray]:
    """Values (N,) of each parameter in its closed range, uniform where it has no law.

    N is at least `MEMBERS`. A law without ``rvs`` is inverted by its ``cdf``.
    """
    rng, members = np.random.default_rng(SEED), tries(MEMBERS)
    found = {}
    for name, (low, high) in ranges.items():
        if name not in laws:
            found[name] = rng.uniform(low, high, members)
            continue
        if not hasattr(laws[name], "rvs"):
            levels = rng.uniform(size=members)
            found[name] = np.array([_quantile(laws[name].cdf, low, high, u) for u in levels])
            continue
        kept = np.empty(0)
        for _ in range(TRIES):
            drawn = np.asarray(laws[name].rvs(size=members, random_state=rng), dtype=float)
            kept = np.append(kept, drawn[(drawn >= low) & (drawn <= high)])
            if kept.size >= members:
                break
        found[name] = kept[:members]
    return found


def _quantile(cdf: Callable[[float], Any], low: float, high: float, level: float) -> float:
    """The least value of the closed range at or below which the given share of its probability
    lies.
    """
    beneath, whole = float(cdf(np.nextafter(low, -np.inf))), float(cdf(high))
    sought = beneath + level * (whole - beneath)
    if float(cdf(low)) >= sought:
        return low
    for _ in range(BISECTIONS):
        middle = low + (high - low) / 2
        low, high = (low, middle) if float(cdf(middle)) >= sought else (middle, high)
    return high


def good_share(
    member: Callable[..., Any], values: Mapping[str, RealArray], gain: float | None
) -> tuple[int, int, int]:
    """Fewest and most good members, and the number of members: some are too close to the limit to
    decide.

    ``member`` gives the StateSpace for values by name. A good member is stable and, if a gain is
    given, has no larger singular value.
    """
    fewest, most, count = 0, 0, min(len(one) for one in values.values())
    for k in range(count):
        system = member(**{name: float(one[k]) for name, one in values.items()})
        rate, rounding = growth(system.A, system.dt)
        sure, possible = rate < -rounding, rate < rounding
        if possible and gain is not None:
            omega = tried_frequencies(np.linalg.eigvals(system.A), dt=system.dt)
            size = float(np.linalg.norm(plain_response(system, omega), 2, axis=(-2, -1)).max())
            sure, possible = (
                sure and size < (1 - CLOSE_SHARE) * gain,
                size < (1 + CLOSE_SHARE) * gain,
            )
        fewest, most = fewest + sure, most + possible
    return fewest, most, count


def probability_agrees(counts: tuple[int, int, int], lower: float, upper: float) -> Check:
    """Check by an exact binomial test that random members do not contradict a probability."""
    fewest, most, count = counts
    too_many = float(stats.binom.sf(fewest - 1, count, upper))
    too_few = float(stats.binom.cdf(most, count, lower))
    return Check(
        "drawn members",
        "negative logarithm of the probability of what was drawn, to base 10",
        float(-np.log10(max(min(too_many, too_few), np.finfo(float).tiny))),
        -np.log10(LEVEL),
        over=f"for {count} members, of which {fewest} to {most} are good",
    )
