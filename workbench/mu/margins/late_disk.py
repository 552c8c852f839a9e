"""Disk margins of a loop with known dead time, which counts exactly as it is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.answer import Answer, PartsChecker, no_better
from workbench.arrays import Array
from workbench.certificate import EVERY_FREQUENCY, Check, Checker
from workbench.heavy_types import StateSpace
from workbench.mu.margins.delayed_loop import DelayedLoop
from workbench.mu.margins.disk import DiskMargin, disk_checks, factor_of
from workbench.mu.robust.destabilising import scalars_at
from workbench.mu.robust.margin_bounds import reciprocal
from workbench.second_opinion import peaks
from workbench.second_opinion.margins.dead_times import distance_at, tried_size

REPEATED_ROUNDING = 1e-9
"""Share by which bounds may be better than those computed again."""
TRIED_ROUNDING = 1e-6
"""Share by which a size that is tried in doubles may be below what is proven of all."""
FAR = 1e150
"""Stands for an infinite L in the factors that it breaks with."""


@dataclass(frozen=True, eq=False)
class LatePeak(Answer):
    """Bounds of 1 over the least |delta| that breaks a loop with dead time, at ``omega`` [rad/s].

    ``omega`` is infinite where the upper bound is approached at infinite frequency only.
    """

    lower: float
    upper: float
    omega: float


@dataclass(frozen=True, eq=False)
class LatePeakChecker(Checker):
    """Checks a `LatePeak` by computing it again; ``pair``: plant and controller have factors."""

    exact: DelayedLoop
    skew: float
    pair: bool
    tolerance: float

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    def checks(self, answer: LatePeak, tolerance: float) -> list[Check]:
        again = _peak(self)
        statement = "by which share it is better than the one computed again"
        return no_better(answer, again.lower, again.upper, statement, REPEATED_ROUNDING)

    def second_opinion(self, answer: LatePeak) -> list[Check]:
        """Frequencies that are tried break with nothing smaller, by matrices in doubles."""
        system, T = self.exact.rational.system, float(self.exact.delay)
        tried = tried_size(system, T, self.skew, self.pair)
        statement = "by which share less breaks the loop at a frequency that is tried"
        return [Check("tried", statement, 1.0 / (answer.upper * tried) - 1.0, TRIED_ROUNDING)]


@dataclass(frozen=True, eq=False)
class LateDiskChecker(PartsChecker):
    """Checks a `DiskMargin` of a loop with dead time."""

    exact: DelayedLoop

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
        system, T = self.exact.rational.system, float(self.exact.delay)
        distance = distance_at(system, T, answer.omega, product)
        statement = "distance from -1 of the loop with the worst factors, relative"
        where = f"at {answer.omega:.6g} rad/s"
        return [Check("worst factors", statement, distance, peaks.NEARLY_SINGULAR, where)]


def late_disk(
    exact: DelayedLoop, channels: tuple[str, ...], skew: float, tolerance: float
) -> DiskMargin:
    """The disk margin of a stable loop in one of its channels, or in plant and controller."""
    checker = LatePeakChecker(exact, skew, len(channels) > 1, tolerance)
    found = _peak(checker).checked_by(checker)
    lower, upper = reciprocal(found.upper), reciprocal(found.lower)
    worst: dict[str, StateSpace] | None = None
    if 0.0 < upper < math.inf and math.isfinite(found.omega):
        Delta = scalars_at(_deltas(exact, found.omega, skew, len(channels)), found.omega)
        factors = [factor_of(Delta, k, k, skew) for k in range(len(channels))]
        if all(f is not None for f in factors):
            worst = dict(zip(channels, factors, strict=True))
    answer = DiskMargin(channels, skew, lower, upper, found.omega, worst, None, found)
    return answer.checked_by(LateDiskChecker(exact))


def _peak(asked: LatePeakChecker) -> LatePeak:
    found = asked.exact.least_size(asked.skew, asked.pair, asked.tolerance)
    return LatePeak(reciprocal(found.upper), reciprocal(found.lower), found.omega)


def _deltas(exact: DelayedLoop, omega: float, skew: float, count: int) -> Array:
    """The smallest deltas (count,) that break the loop at a frequency."""
    L = complex(exact.response(np.array([omega])).item())
    L = L if np.isfinite(L) else FAR + 0j
    A = ((1.0 + skew) / 2.0 + (skew - 1.0) / 2.0 * L) / (1.0 + L)
    if count == 1:
        return np.array([1.0 / A])
    B = np.sqrt(L) / (1.0 + L)
    left, sizes, right = np.linalg.svd(np.array([[A, -B], [B, A]]))
    found: Array = right[0].conj() / (left[:, 0] * sizes[0])
    return found
