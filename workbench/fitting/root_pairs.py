"""Damping ratios and frequencies of root pairs, as linear functions of a fit's parameters."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.fitting.factored import FactoredRational

DAMPING, FREQUENCY = np.array([-0.5, 1.0, -0.5]), np.array([0.5, 0.0, -0.5])
"""Combinations of the logarithms (3,) of the coefficients of c0 + c1 x + c2 x^2 that give log 2
damping and log frequency.
"""


def pair_logarithms(function: FactoredRational) -> tuple[RealArray, RealArray]:
    """Logarithms of damping ratio and frequency [rad/s] of each pair of roots left of the axis.

    Both are linear in the parameters (P,): the rows (K, P + 1) hold their coefficients, and the
    constant at the end. A damping ratio above 1 belongs to two real roots.
    """
    damping, frequency, at = [], [], 0
    count = function.start.size
    for part in function.parts:
        moving = list(part.moving)
        if part.positive and len(moving) == 2:
            rows = np.zeros((2, count + 1))
            held = 3 - sum(moving)
            for row, combined in zip(rows, (DAMPING, FREQUENCY), strict=True):
                row[at : at + 2] = combined[moving]
                row[-1] = combined[held] * np.log(part.coefficients[held])
            rows[:, -1] += -np.log(2.0), np.log(abs(part.level))
            damping.append(rows[0])
            frequency.append(rows[1])
        at += len(moving)
    shape = (-1, count + 1)
    return np.array(damping).reshape(shape), np.array(frequency).reshape(shape)
