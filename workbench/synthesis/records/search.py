"""The least rate that can be proven, by bisection."""

from __future__ import annotations

from collections.abc import Callable

from workbench.executor import Context
from workbench.synthesis.records.inequalities import ProvenFeedback

BISECTIONS = 12
"""Halvings of the interval from 0 to 1, in which the rate lies."""


def least_rate(
    proven: Callable[[float], ProvenFeedback | None], context: Context
) -> ProvenFeedback | None:
    """The answer of the least rate per sample found; None where the rate 1 has none.

    ``proven`` returns an answer of a rate, or None.
    """
    best = proven(1.0)
    if best is None:
        return None
    low, high = 0.0, 1.0
    for _ in context.track(range(BISECTIONS), "rates"):
        rate = (low + high) / 2
        answer = proven(rate)
        if answer is None:
            low = rate
        else:
            best, high = answer, rate
    return best
