"""Margins of robust stability and performance, and the checks that prove them again."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np

from workbench._core.heavy_types import Figure
from workbench.answer import Answer, PartsChecker, RepeatedChecker, no_better
from workbench.certificate import EVERY_FREQUENCY, Check
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.delay_margins import delay_is_borne, delay_is_lost
from workbench.second_opinion import peaks
from workbench.uncertainty.algebra.closing import IllPosedError
from workbench.uncertainty.algebra.system import UncertainSystem

REPROVEN_SHARE = 1 - 1e-6
"""Share of a delay that is proven again: the search stops where the proof has no room left. With
half of the distance from 1 a run on another processor may be refused; double proves 2e-6 less.
"""
TRIED_DELAYS = 9
"""Number of delays that a second opinion tries, up to the proven one. A second opinion on few
delays finds a proof that is wrong in a wide range. With half of them a wrong one is found less
surely; double costs time.
"""
RECIPROCAL_ROUNDING = 1e-15
"""Relative excess allowed for the rounded reciprocal of a bound. One division rounds by 1.1e-16,
and its comparison again. With a tenth of it true reciprocals fail; half or double changes nothing.
"""
TRIED_SHARE, LONGEST_TRIED = 0.99, 1e3
"""Largest share of the proven delay at which Pade approximations are tried, since their phase errs
by 0.01 rad within the turn in which a delay is lost; and the largest delay tried, in longest delays
of the set. Half of either tries less of a proof; double of the first would try delays that break
the loop, and of the second no more than a set means.
"""
LARGEST_TRIED = 1e3
"""Size of the perturbations that are tried where the margin is infinite. A loop without a margin
must stay stable for any size; at larger sizes poles lose the digits that the trial needs. Half or
double is a weaker or slightly stronger trial.
"""


@dataclass(frozen=True, eq=False, repr=False)
class StabilityMargin(Answer):
    """Bounds of the factor by which all uncertainty may grow before the system is unstable.

    Unlike `LoopMargins`, it is the factor of a modelled uncertainty.

    Stability is proven for every perturbation smaller than ``lower``. ``worst`` is a perturbation
    of size ``upper``, by name, that makes the system unstable at ``omega`` [rad/s]: values of
    parameters, and dynamics as systems. ``worst`` is None, and ``upper`` infinite, if no
    perturbation was found. With a factor above 1 the system is stable for all of its uncertainty.
    ``peak`` is the peak of mu that proves the bounds; if all elements are real it is None, and
    ``parts`` of their box were examined instead (see `workbench.mu.boxes`). With a sampling time
    ``dt`` [s] the bounds are about the sampled system, whose perturbations are sampled with it: for
    a continuous plant under a sampled controller see `workbench.synthesis.sampled_robustness`.

    The factor multiplies normalised perturbations. For an uncertain delay it does not multiply the
    time: a smaller disc about the case without delay contains no true delay at all frequencies.
    ``delays`` [s] has two numbers by name: the delay up to which stability is proven, for all
    values of the other elements within their sets; and a delay with which the loop is unstable, the
    other elements nominal. If one delay is the only uncertain element, and occurs once, both are
    exact but for a share of 1e-6. ``idle_elements`` are the names of elements that cannot move a
    pole, such as k in k - k; they are left out before the computation.
    """

    lower: float
    upper: float
    omega: float
    worst: Mapping[str, Any] | None
    peak: Peak | None
    _: KW_ONLY
    parts: int = 0
    dt: float = 0.0
    delays: Mapping[str, tuple[float, float]] = field(default_factory=dict, kw_only=True)
    idle_elements: tuple[str, ...] = field(default=(), kw_only=True)

    def summary(self) -> str:
        verdict = "not decided for all of its uncertainty"
        if self.lower > 1:
            verdict = "stable for all of its uncertainty"
        elif self.upper < 1:
            verdict = "NOT stable for all of its uncertainty"
        lines = [
            f"StabilityMargin: from {self.lower:.5g} to {self.upper:.5g}, {verdict}",
            *([] if math.isnan(self.omega) else [f"  at {self.omega:.5g} rad/s"]),
        ]
        for name, value in (self.worst or {}).items():
            order = getattr(value, "nstates", None)
            shown = f"{value:.6g}" if order is None else f"a system of order {order}"
            lines.append(f"  worst {name}: {shown}")
        if self.delays:
            lines.append("  the factor is one of disks that contain the delays, none of seconds:")
        for name, (borne, lost) in self.delays.items():
            until = f"unstable with {lost:.5g} s" if math.isfinite(lost) else "no longer one found"
            lines.append(f"  {name}: any delay up to {borne:.5g} s, {until}")
        if self.idle_elements:
            lines.append(f"  without effect on stability: {', '.join(self.idle_elements)}")
        if self.dt:
            lines.append(f"  at the samples, every {self.dt:.6g} s; perturbations are sampled too")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False, repr=False)
class PerformanceMargin(Answer):
    """Bounds of the factor by which all uncertainty may grow before a gain exceeds its level.

    Unlike a `StabilityMargin`, it keeps a gain, not only stability.

    For every perturbation of a size up to ``lower`` the largest gain is proven to stay below
    ``gain``; for some perturbation of size ``upper`` it is proven to reach ``gain``, at ``omega``
    [rad/s]. Both bounds are 0 if the nominal gain reaches the level already.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import robust_performance
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> margin = robust_performance(closed, gain=3.0)
    >>> margin.gain, margin.omega >= 0
    (3.0, True)
    """

    lower: float
    upper: float
    omega: float
    gain: float

    def summary(self) -> str:
        return (
            f"PerformanceMargin: gain below {self.gain:g} for uncertainty up to {self.lower:.5g} "
            f"to {self.upper:.5g} times its size, at {self.omega:.5g} rad/s"
        )


def reciprocal(value: float) -> float:
    """1 / value; infinite for 0."""
    return 1 / value if value > 0 else math.inf


@dataclass(frozen=True, eq=False)
class StabilityChecker(PartsChecker):
    """Checks a `StabilityMargin` of a system whose poles must all lie left of the axis.

    ``again`` computes the margin anew; it decides where no peak proves the bounds, or not both of
    them.
    """

    systems: tuple[UncertainSystem, ...]
    again: Callable[[], StabilityMargin]

    @property
    def quantifier(self) -> str:
        return "for every perturbation of a size below the lower bound"

    def parts(self, answer: StabilityMargin) -> Mapping[str, Peak | None]:
        return {"mu": answer.peak}

    def checks(self, answer: StabilityMargin, tolerance: float) -> list[Check]:
        if answer.peak is None or len(self.systems) > 1:
            return RepeatedChecker(self.again, self.quantifier).checks(answer, tolerance)
        lower, upper = reciprocal(answer.peak.upper), reciprocal(answer.peak.lower)
        statement = "by which share it is better than the reciprocal of a proven bound of the peak"
        found = no_better(answer, lower, upper, statement, RECIPROCAL_ROUNDING)
        for name, claimed in answer.delays.items():
            found += self._delay_checks(name, *claimed)
        return found

    def _delay_checks(self, name: str, borne: float, lost: float) -> list[Check]:
        (system,) = self.systems
        over = f"for every delay {name} up to it, whatever the other elements are"
        found = [
            Check(
                f"{name} borne",
                "whether the delay is not proven to be borne, at 1 - 1e-6 of it",
                float(borne > 0 and not delay_is_borne(system, name, REPROVEN_SHARE * borne)),
                0.0,
                over=over,
            )
        ]
        if math.isfinite(lost):
            stable = float(not delay_is_lost(system, name, lost))
            statement = "whether the loop of the nominals is stable with the delay"
            found.append(Check(f"{name} lost", statement, stable, 0.0, over="for this one delay"))
        return found

    def figures(self, answer: StabilityMargin) -> dict[str, Figure]:
        """Mu over frequency, whose reciprocal is the margin; none for real parameters alone."""
        return {} if answer.peak is None else {"mu": answer.peak.plot()}

    def second_opinion(self, answer: StabilityMargin) -> list[Check]:
        found = []
        if 0.0 < answer.lower < math.inf:
            found += [
                peaks.sampled_loops(one.system, one.structure, 1 / answer.lower)
                for one in self.systems
            ]
        if answer.worst is not None:
            with contextlib.suppress(IllPosedError):  # a pole went through infinity
                members = [one.at(**answer.worst) for one in self.systems]
                nominals = [one.nominal for one in self.systems]
                found.append(peaks.one_unstable(members, nominals))
        for name, (borne, _) in answer.delays.items():
            element = self.systems[0].elements[name]
            longest = min(TRIED_SHARE * borne, LONGEST_TRIED * element.high)  # type: ignore[attr-defined]
            tried = np.linspace(0.0, longest, TRIED_DELAYS).tolist()
            members = [self.systems[0].at(**{name: tau}) for tau in tried]
            found.append(peaks.all_decay(members, f"{name} tried"))
        return found


@dataclass(frozen=True, eq=False)
class UnlimitedChecker(RepeatedChecker):
    """Checks by a new computation and by perturbations that no element can move the poles."""

    system: UncertainSystem

    def second_opinion(self, answer: StabilityMargin) -> list[Check]:
        tried = peaks.sampled_loops(self.system.system, self.system.structure, 1 / LARGEST_TRIED)
        return [replace(tried, over=f"{tried.over} of size {LARGEST_TRIED:g}")]


@dataclass(frozen=True, eq=False)
class PerformanceChecker(PartsChecker):
    """Checks a `PerformanceMargin` by the peaks at two factors; None: no peak was proven there."""

    factors: tuple[float, float]
    at_lower: Peak | None
    at_upper: Peak | None

    @property
    def quantifier(self) -> str:
        return f"{EVERY_FREQUENCY}, for every perturbation of a size up to the lower bound"

    def parts(self, answer: PerformanceMargin) -> Mapping[str, Peak | None]:
        return {"lower": self.at_lower, "upper": self.at_upper}

    def checks(self, answer: PerformanceMargin, tolerance: float) -> list[Check]:
        low, high = self.at_lower, self.at_upper
        kept = self.factors[0] if low is not None and low.upper < 1.0 else 0.0
        lost = self.factors[1] if high is not None and high.lower >= 1.0 else math.inf
        statement = "by which share it is better than the factor at which a peak proves it"
        return no_better(answer, kept, lost, statement, 0.0)
