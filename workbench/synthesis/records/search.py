"""The least decay rate that can be proven, by bisection."""

from __future__ import annotations

from collections.abc import Callable

from workbench.executor import Context
from workbench.synthesis.records.inequalities import ProvenFeedback

BISECTIONS = 12
"""Number of halvings of the interval from 0 to 1, which contains the rate."""


def least_rate(
    proven: Callable[[float], ProvenFeedback | None], context: Context
) -> ProvenFeedback | None:
    """The answer with the least rate per sample found; None if there is none for the rate 1.

    ``proven`` returns an answer for a rate, or None.
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
