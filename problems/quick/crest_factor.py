"""Multisines with a low crest factor."""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench import problem
from workbench.identification import CrestFactor

LINES = {"eight-lines": np.arange(1, 9), "odd-lines": np.arange(1, 48, 2)}


@problem("quick/{lines}/crest-factor", lines=("eight-lines", "odd-lines"))
def crest_factor(lines: Literal["eight-lines", "odd-lines"]) -> CrestFactor:
    """The phases of a flat multisine with the lowest ratio of peak to rms value.

    The lines are 1 to 8, or the 24 odd lines up to 47. The even lines then stay free and show
    distortions.
    """
    chosen = LINES[lines]
    return CrestFactor(1.0, chosen, 8 * int(chosen[-1] + 1))
