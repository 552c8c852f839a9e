"""Random switchings, each repeated for ever: is the system stable?"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, product
from typing import Any

import flint
import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor.effort import tries
from workbench.second_opinion import SEED
from workbench.second_opinion.powers import BITS, PRECISE_ROUNDING, growth, precise_growth

SWITCHINGS = 40
"""Number of periodic switchings tried for every plant."""
SHORT_STAYS = 8
"""Number of stays, from the shortest on, that are tried for every two modes."""
ENTRIES = (2, 7)
"""Fewest and most visits to modes in one period."""
CLOSE_GROWTH = 1e-3
"""Growth that is below 0 by less than this is computed again in many bits."""
LONGEST_RATIO = 3.0
"""Stays without a longest one are drawn up to this multiple of the shortest."""


def fastest_growth(
    transitions: Sequence[RealArray], shortest: Sequence[int], longest: Sequence[int | None]
) -> tuple[float, str]:
    """The largest growth of a plant over one period, less its rounding, and its switching.

    Parameters
    ----------
    transitions
        A (V, n, n) of each mode: V plants over one sample.
    shortest, longest
        Stays [samples] of each mode; None: without a longest.

    Returns
    -------
    Logarithm of the growth in one period: below 0 if every switching tried is stable.
    """
    rng = np.random.default_rng(SEED)
    best, words = -math.inf, ""
    for modes, stays in switchings(rng, shortest, longest):
        for plant in range(len(transitions[0])):
            found = _growth(_period([A[plant] for A in transitions], modes, stays))
            if found > best:
                steps = ", ".join(f"{n} in mode {i + 1}" for i, n in zip(modes, stays, strict=True))
                best, words = found, f"for plant {plant + 1}: {steps}"
    return best, words


def _period(transitions: Sequence[RealArray], modes: Sequence[int], stays: Sequence[int]) -> Any:
    """The transition (n, n) of one plant over one period, in BITS bits."""
    with flint.ctx.workprec(BITS):
        period = flint.arb_mat(np.eye(len(transitions[0])).tolist())
        for i, stay in zip(modes, stays, strict=True):
            period = flint.arb_mat(transitions[i].tolist()) ** stay * period
        return period.mid()


def _growth(period: Any) -> float:
    """Logarithm of the growth in one period, less the possible effect of rounding."""
    rate, rounding = growth(np.array(period.tolist(), dtype=float), 1.0)
    if rate < -max(rounding, CLOSE_GROWTH):
        return float(rate + rounding)
    return precise_growth(period) - PRECISE_ROUNDING


def switchings(
    rng: np.random.Generator, shortest: Sequence[int], longest: Sequence[int | None]
) -> Iterator[tuple[list[int], list[int]]]:
    """Modes and stays of every period: all short stays of every pair of modes, then random ones."""
    last = [math.inf if end is None else end for end in longest]
    for i, j in combinations(range(len(shortest)), 2):
        for n, m in product(range(SHORT_STAYS), repeat=2):
            if shortest[i] + n <= last[i] and shortest[j] + m <= last[j]:
                yield [i, j], [shortest[i] + n, shortest[j] + m]
    for number in range(tries(SWITCHINGS)):
        modes = _sequence(rng, len(shortest), number)
        yield modes, [_stay(rng, shortest[i], longest[i], number) for i in modes]


def _sequence(rng: np.random.Generator, modes: int, number: int) -> list[int]:
    """A closed sequence of modes in which none occurs twice in a row; the first sequences are
    pairs.
    """
    if number < modes * (modes - 1) // 2 or modes == 2:
        pairs = [(i, j) for i in range(modes) for j in range(i + 1, modes)]
        return list(pairs[number % len(pairs)]) * (1 if number < len(pairs) else number % 3 + 1)
    length = int(rng.integers(*ENTRIES))
    found = [int(rng.integers(modes))]
    while len(found) < length or found[-1] == found[0]:
        found.append(int((found[-1] + rng.integers(1, modes)) % modes))
    return found


def _stay(rng: np.random.Generator, shortest: int, longest: int | None, number: int) -> int:
    """An allowed stay; in the first half of the switchings the shortest one, which is most often
    the worst.
    """
    if number < tries(SWITCHINGS) // 2:
        return shortest
    last = longest if longest is not None else int(LONGEST_RATIO * shortest) + 1
    return int(rng.integers(shortest, max(last, shortest) + 1))
