"""The least disk factor that breaks a loop with dead time, and the checks that prove it."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.answer import REPEATED_ROUNDING, Answer, no_better
from workbench.certificate import EVERY_FREQUENCY, Check, Checker
from workbench.mu.loops.coupled_loop import CoupledLoop
from workbench.mu.loops.delayed_loop import DelayedLoop
from workbench.mu.margins.classical_checks import tried_loop
from workbench.mu.robust.margin_bounds import reciprocal
from workbench.second_opinion.margins.dead_times import tried_size

TRIED_ROUNDING = 1e-6
"""A size tried in doubles may be below the proven least size by this share. A response in doubles
beside a lightly damped pole has six to eight digits. With half of it a true bound may be
contradicted; double overlooks 2e-6.
"""


@dataclass(frozen=True, eq=False)
class LatePeak(Answer):
    """Bounds of 1 over the least |delta| that breaks a loop with dead time, at ``omega`` [rad/s].

    Unlike a `Peak`, it is of one factor and an exact dead time, so it needs no scalings.

    ``omega`` is infinite if the upper bound is only approached at infinite frequency.
    """

    lower: float
    upper: float
    omega: float


@dataclass(frozen=True, eq=False)
class LatePeakChecker(Checker):
    """Checks a `LatePeak` by computing it again; ``pair``: plant and controller have factors."""

    exact: DelayedLoop | CoupledLoop
    skew: float
    pair: bool
    tolerance: float

    @property
    def quantifier(self) -> str:
        return EVERY_FREQUENCY

    def checks(self, answer: LatePeak, tolerance: float) -> list[Check]:
        again = _bounds(self)
        statement = "by which share it is better than the one computed again"
        return no_better(answer, again.lower, again.upper, statement, REPEATED_ROUNDING)

    def second_opinion(self, answer: LatePeak) -> list[Check]:
        """Check with matrices in doubles: at the frequencies tried, no smaller factor breaks the
        loop.
        """
        if isinstance(self.exact, CoupledLoop):
            tried = tried_loop(self.exact).least_size(self.skew)
        else:
            system, T = self.exact.rational.system, float(self.exact.delay)
            tried = tried_size(system, T, self.skew, self.pair)
        statement = "by which share less breaks the loop at a frequency that is tried"
        return [Check("tried", statement, 1.0 / (answer.upper * tried) - 1.0, TRIED_ROUNDING)]


def late_peak(
    exact: DelayedLoop | CoupledLoop, skew: float, pair: bool, tolerance: float
) -> LatePeak:
    """Bounds for a stable loop; ``pair``: plant and controller have a factor each."""
    asked = LatePeakChecker(exact, skew, pair, tolerance)
    return _bounds(asked).with_checker(asked)


def _bounds(asked: LatePeakChecker) -> LatePeak:
    found = asked.exact.least_delta(asked.skew, asked.pair, asked.tolerance)
    return LatePeak(reciprocal(found.upper), reciprocal(found.lower), found.omega)
