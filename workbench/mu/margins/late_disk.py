"""Disk margins of a loop with known dead time, which is treated exactly."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker
from workbench.certificate import Check
from workbench.mu.loops.coupled_loop import CoupledLoop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.mu.margins.classical_checks import tried_loop
from workbench.mu.margins.disk import DiskMargin, disk_checks, factor_of
from workbench.mu.margins.late_peak import late_peak
from workbench.mu.robust.destabilising import scalars_at
from workbench.mu.robust.margin_bounds import reciprocal
from workbench.second_opinion import peaks
from workbench.second_opinion.margins.dead_times import distance_at

FAR = 1e150
"""Number that stands for an infinite L in the factors that break the loop. Its products with
factors near 1 are doubles. Half or double changes nothing.
"""


@dataclass(frozen=True, eq=False)
class LateDiskChecker(PartsChecker):
    """Checks a `DiskMargin` of a loop with dead time."""

    exact: DelayedLoop | CoupledLoop

    @property
    def quantifier(self) -> str:
        return "for this one plant, for all factors of the disk"

    def parts(self, answer: DiskMargin) -> Mapping[str, Answer]:
        return {"size": answer.proof}

    def checks(self, answer: DiskMargin, tolerance: float) -> list[Check]:
        return disk_checks(answer)

    def second_opinion(self, answer: DiskMargin) -> list[Check]:
        if answer.worst is None:
            return []
        product = math.prod(complex(f(1j * answer.omega)) for f in answer.worst.values())
        if isinstance(self.exact, CoupledLoop):
            distance = tried_loop(self.exact).distance_at(answer.omega, product)
        else:
            system, T = self.exact.rational.system, float(self.exact.delay)
            distance = distance_at(system, T, answer.omega, product)
        statement = "distance from -1 of the loop with the worst factors, relative"
        where = f"at {answer.omega:.6g} rad/s"
        return [Check("worst factors", statement, distance, peaks.NEARLY_SINGULAR, where=where)]


def late_disk(
    exact: DelayedLoop | CoupledLoop, channels: tuple[str, ...], skew: float, tolerance: float
) -> DiskMargin:
    """The disk margin of a stable loop in one of its channels, or in plant and controller."""
    found = late_peak(exact, skew, len(channels) > 1, tolerance)
    lower, upper = reciprocal(found.upper), reciprocal(found.lower)
    worst: dict[str, StateSpace] | None = None
    if 0.0 < upper < math.inf and math.isfinite(found.omega):
        Delta = scalars_at(_deltas(exact, found.omega, skew, len(channels)), found.omega)
        factors = [factor_of(Delta, k, k, skew) for k in range(len(channels))]
        if all(f is not None for f in factors):
            worst = dict(zip(channels, factors, strict=True))
    answer = DiskMargin(channels, skew, lower, upper, found.omega, worst, None, found)
    return answer.with_checker(LateDiskChecker(exact))


def _deltas(exact: DelayedLoop | CoupledLoop, omega: float, skew: float, count: int) -> Array:
    """The smallest deltas (count,) that put a pole of the loop at a frequency."""
    L = complex(exact.response(np.array([omega])).item())
    L = L if np.isfinite(L) else FAR + 0j
    A = ((1.0 + skew) / 2.0 + (skew - 1.0) / 2.0 * L) / (1.0 + L)
    if count == 1:
        return np.array([1.0 / A])
    B = np.sqrt(L) / (1.0 + L)
    left, sizes, right = np.linalg.svd(np.array([[A, -B], [B, A]]))
    found: Array = right[0].conj() / (left[:, 0] * sizes[0])
    return found
