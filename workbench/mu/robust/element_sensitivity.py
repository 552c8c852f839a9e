"""How much each uncertain element counts for a margin of robustness."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.mu.robust.margin import robust_performance, robust_stability
from workbench.uncertainty.algebra.lft import LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain


def margin_sensitivity(
    system: Any, gain: float | None = None, growth: float = 0.25, tolerance: float = 1e-4
) -> dict[str, tuple[float, float]]:
    """Bounds, by name, of how much each element counts: 0 for not at all, 1 for all alone.

    The reciprocal of the margin rises by a share, over that by which one element's uncertainty
    grows: 0.75 says that with 25 % more of this uncertainty the rest may be 0.75 x 25 % less.

    Parameters
    ----------
    system
        As in `robust_stability`.
    gain
        None: the margin of robust stability; else that of robust performance at this level.
    growth
        The share by which the uncertainty of one element grows, the others unchanged.
    tolerance
        Of the margins; their bounds over the growth are the width of the result.

    Raises
    ------
    InputError
        As `robust_stability` and `robust_performance`; or the margin itself is 0 or infinite.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import margin_sensitivity
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> low, high = margin_sensitivity(closed)["k"]
    >>> low <= 1 <= high  # the only element counts alone
    True
    """
    need_positive(growth, "growth")

    def margin(one: Any) -> tuple[float, float]:
        found = (
            robust_stability(one, tolerance)
            if gain is None
            else robust_performance(one, gain, tolerance)
        )
        return found.lower, found.upper

    known = uncertain(system, "system")
    low, high = margin(known)
    if not 0.0 < low <= high < math.inf:
        raise InputError(f"the margin lies between {low:g} and {high:g}: it has no sensitivity")
    sizes: dict[str, tuple[float, float]] = {}
    for name in known.elements:
        least, most = margin(_grown(known, name, 1.0 + growth))
        # A margin does not rise where the set grows.
        rises = max(low / most - 1.0, 0.0), max(high / least - 1.0, 0.0)
        sizes[name] = rises[0] / growth, rises[1] / growth
    return sizes


def _grown(system: UncertainSystem, name: str, factor: float) -> UncertainSystem:
    """The system with the normalised perturbation of one element multiplied by a factor."""
    channels = system.elements[name].channels
    rows = np.array([one in channels for one in system.value.names], bool)
    M = system.value.M.copy()
    M[: len(rows)][rows] *= factor
    return replace(system, value=LFT(M, system.value.names))
