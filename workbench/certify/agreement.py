"""Bounds of the same quantity must agree: a lower bound above an upper one is an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import ContradictionError

SINGULAR_PROVEN = "ball arithmetic proves that a perturbation of this size makes the loop singular"
"""What lower bounds of mu rest on."""
MULTIPLIERS = "its multipliers D and G prove the bound"
"""What upper bounds of mu rest on."""


def need_agreement(
    lower: ArrayLike,
    upper: ArrayLike,
    what: str = "mu",
    lower_claim: str = SINGULAR_PROVEN,
    upper_claim: str = MULTIPLIERS,
    place: Callable[[tuple[int, ...]], str] = lambda index: f"at index {index}" if index else "",
) -> None:
    """Raise ContradictionError if a lower bound is above the upper bound at the same place.

    Parameters
    ----------
    lower, upper
        Bounds of the same shape, rounded inward and outward, so that no tolerance is needed.
    what, lower_claim, upper_claim
        The quantity, and what each bound rests on, for the message.
    place
        Function that names an index of the bounds, for the message.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    wrong = np.argwhere(low > high)
    if len(wrong):
        index = tuple(int(i) for i in wrong[0])
        where = f"{what} {place(index)}".strip()
        raise ContradictionError(
            where, float(low[index]), lower_claim, float(high[index]), upper_claim
        )
