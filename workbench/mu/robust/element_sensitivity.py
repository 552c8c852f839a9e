"""How much each uncertain element contributes to a margin of robustness."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.answer import Answer, PartsChecker
from workbench.certificate import Check
from workbench.certify.agreement import need_agreement
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.mu.robust.margin import robust_performance, robust_stability
from workbench.mu.robust.margin_bounds import (
    RECIPROCAL_ROUNDING,
    PerformanceMargin,
    StabilityMargin,
)
from workbench.uncertainty.algebra.lft import LFT
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

Margin = StabilityMargin | PerformanceMargin


@dataclass(frozen=True, eq=False, repr=False)
class MarginSensitivity(Answer, Mapping[str, tuple[float, float]]):
    """Bounds, by name, of how much each uncertain element contributes to a margin.

    ``margin`` is the margin of the system itself; ``grown`` has the margins with the uncertainty of
    one element increased by the share ``growth``.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import margin_sensitivity
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> found = margin_sensitivity(closed)
    >>> list(found), found.holds
    (['k'], True)
    """

    bounds: Mapping[str, tuple[float, float]]
    growth: float
    margin: Margin
    grown: Mapping[str, Margin]

    def __getitem__(self, name: str) -> tuple[float, float]:
        return self.bounds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.bounds)

    def __len__(self) -> int:
        return len(self.bounds)

    @property
    def value(self) -> RealArray:
        """The bounds (elements, 2), in the order of the names."""
        return np.array(list(self.bounds.values()))

    def summary(self) -> str:
        of = (f"  {name}: {low:.4g} to {high:.4g}" for name, (low, high) in self.bounds.items())
        return "\n".join(["MarginSensitivity: 1 for an element that counts alone", *of])


class SensitivityChecker(PartsChecker):
    """Checks a `MarginSensitivity` by the margins from which it is computed."""

    @property
    def quantifier(self) -> str:
        return "for a growth of one element at a time"

    def parts(self, answer: MarginSensitivity) -> Mapping[str, Margin]:
        grown = {f"with more of {name}": one for name, one in answer.grown.items()}
        return {"margin": answer.margin, **grown}

    def checks(self, answer: MarginSensitivity, tolerance: float) -> list[Check]:
        again = {
            name: _rises(answer.margin, one, answer.growth) for name, one in answer.grown.items()
        }
        other = max(
            (max(low - again[name][0], again[name][1] - high) if name in again else math.inf)
            for name, (low, high) in answer.bounds.items()
        )
        statement = "by how much a bound is closer than its margins say"
        return [Check("bounds", statement, other, 0.0)]


def margin_sensitivity(
    system: Any, *, gain: float | None = None, growth: float = 0.25, tolerance: float = 1e-4
) -> MarginSensitivity:
    """Bounds, by name, of how much each element contributes: 0 for nothing, 1 for everything.

    The number is the relative increase of the margin's reciprocal over the relative increase of one
    element's uncertainty. At 0.75, with 25 % more of this uncertainty the rest may be 0.75 x 25 %
    less.

    Parameters
    ----------
    system
        As in `robust_stability`.
    gain
        None: the margin of robust stability; otherwise the margin of robust performance at this
        gain.
    growth
        The share by which the uncertainty of one element grows, the others unchanged.
    tolerance
        Tolerance of the margins. The width of the result is the width of their bounds divided by
        ``growth``.

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

    def margin(one: Any) -> Margin:
        if gain is None:
            return robust_stability(one, tolerance=tolerance)
        return robust_performance(one, gain=gain, tolerance=tolerance)

    known = uncertain(system, "system")
    own = margin(known)
    if not 0.0 < own.lower <= own.upper < math.inf:
        between = f"{own.lower:g} and {own.upper:g}"
        raise InputError(f"the margin lies between {between}: it has no sensitivity")
    grown = {name: margin(_grown(known, name, 1.0 + growth)) for name in known.elements}
    for name, one in grown.items():
        need_agreement(
            (1 - RECIPROCAL_ROUNDING) * one.lower,
            own.upper,
            "the margin",
            f"it is proven with more of {name}, in a larger set",
            "a perturbation of the set itself",
        )
    bounds = {name: _rises(own, one, growth) for name, one in grown.items()}
    return MarginSensitivity(bounds, growth, own, grown).with_checker(SensitivityChecker())


def _rises(own: Margin, grown: Margin, growth: float) -> tuple[float, float]:
    """Bounds of the relative increase of the margin's reciprocal, divided by the growth of the
    set.
    """
    # A margin cannot rise when the set grows.
    low, high = max(own.lower / grown.upper - 1.0, 0.0), max(own.upper / grown.lower - 1.0, 0.0)
    return low / growth, high / growth


def _grown(system: UncertainSystem, name: str, factor: float) -> UncertainSystem:
    """The system with the normalised perturbation of one element multiplied by a factor."""
    channels = system.elements[name].channels
    rows = np.array([one in channels for one in system.value.names], bool)
    M = system.value.M.copy()
    M[: len(rows)][rows] *= factor
    return replace(system, value=LFT(M, system.value.names))
