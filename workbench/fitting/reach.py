"""Roots very far from the data, moved to where doubles can realise them."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational

MIN_ROOT_DAMPING = 1e-9
"""Smallest damping ratio of a root on the left of the imaginary axis."""


def within_reach(function: Rational, omega: RealArray, reach: float) -> Rational:
    """The function with its roots at most a factor ``reach`` beyond the first or last frequency.

    Data at frequencies omega [rad/s] only show that such a root is far away: moving it changes the
    response there by about 1 / reach, relatively. Left where it was, the realisation would be a
    small difference of huge numbers.
    """
    low, high = omega[0] / reach, omega[-1] * reach

    def moved(roots: ComplexArray) -> tuple[ComplexArray, float]:
        size = np.abs(roots)
        unit = np.divide(roots, size, out=-np.ones_like(roots), where=size > 0)
        unit.real = np.where(unit.real <= 0, np.minimum(unit.real, -MIN_ROOT_DAMPING), unit.real)
        return unit * np.clip(size, low, high), float(np.prod(size[size > high] / high))

    (zeros, more), (poles, less) = moved(function.zeros), moved(function.poles)
    return Rational(zeros, poles, function.gain * more / less)
