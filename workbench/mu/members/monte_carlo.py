"""Monte Carlo: a quantity of many random members, with quantiles and their confidence.

Samples say how often a value occurs. A bound for every member is proven elsewhere and shown beside
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy import stats

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure, StateSpace
from workbench.errors import InputError, WorkbenchError
from workbench.executor import InProcess, spread
from workbench.input_checks import is_real, need_count, need_whole
from workbench.mu.robust.worst_case import worst_case_gain
from workbench.systems.realisation import worst_pole
from workbench.uncertainty.algebra.system import MOST_MEMBERS, UncertainSystem, uncertain

SHOWN = (0.5, 0.9, 0.99)
"""Probabilities of the quantiles that are printed: the middle, and what most and nearly all members
keep. Other shares are asked for by `quantile`. Half of all would leave out the members that matter;
double is no probability.
"""
BATCH = 25
"""Number of members per task. Half or double changes the time that is lost by handing over tasks,
and no number.
"""
BOUND_TOLERANCE = 1e-2
"""Tolerance of the proven bound. It stands beside quantiles that are known to a few percent. Half
takes longer; double loosens the bound by 1 %.
"""


@dataclass(frozen=True, eq=False)
class MonteCarlo:
    """A quantity of random members, ``values`` (N,), infinite where a member has none.

    ``bound`` is proven for every member, NaN if nothing is proven. ``confidence`` is that of the
    intervals.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import monte_carlo
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> found = monte_carlo(closed, quantity=lambda member: float(member.dcgain()), count=20)
    >>> found.confidence, bool(found.values.max() < 0.8)
    (0.95, True)
    """

    values: RealArray
    name: str
    confidence: float
    bound: float

    def quantile(self, share: float) -> tuple[float, float, float]:
        """The quantile of the sample, and the ends of the interval for the quantile of all members.

        The ends are order statistics and hold for any distribution; an end is infinite if there are
        too few members.
        """
        _need_share(share, "share")
        ordered, n = np.sort(self.values), len(self.values)
        rest = (1.0 - self.confidence) / 2.0
        low = int(stats.binom.ppf(rest, n, share)) - 1
        high = int(stats.binom.ppf(1.0 - rest, n, share))
        place = min(math.ceil(share * n), n) - 1
        return (
            float(ordered[max(place, 0)]),
            float(ordered[low]) if low >= 0 else -math.inf,
            float(ordered[high]) if high < n else math.inf,
        )

    def probability(self, level: float) -> tuple[float, float, float]:
        """The share of members up to a level, and its interval for all members
        (Clopper-Pearson).
        """
        if not is_real(level) or math.isnan(level):
            raise InputError(f"level is {level!r}; a number is needed")
        n = len(self.values)
        below = int((self.values <= level).sum())
        found = stats.binomtest(below, n).proportion_ci(self.confidence, "exact")
        return below / n, float(found.low), float(found.high)

    def __repr__(self) -> str:
        lines = [f"MonteCarlo: {self.name} of {len(self.values)} members"]
        for share in SHOWN:
            middle, low, high = self.quantile(share)
            lines.append(
                f"  {share:.0%} of them up to {middle:.5g}; with confidence {self.confidence:.0%} "
                f"between {low:.5g} and {high:.5g}"
            )
        lines.append(f"  largest seen {self.values.max():.5g}")
        if not math.isnan(self.bound):
            lines.append(f"  proven for every member: at most {self.bound:.5g}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Figure of the share of members up to each value, with the proven bound."""
        figure, (panel,) = figures.axes(1, 1)
        ordered = np.sort(self.values)
        share = np.arange(1, len(ordered) + 1) / len(ordered)
        finite = np.isfinite(ordered)
        panel.step(ordered[finite], share[finite], where="post", label="random members")
        if math.isfinite(self.bound):
            panel.axvline(self.bound, color=figures.BLACK, linestyle="--", label="proven bound")
        panel.set_ylim(0.0, 1.02)
        figures.label(panel, x=f"{self.name} [1]", y="share of members [1]")
        figures.legend_below(figure, panel)
        return figure


def monte_carlo(
    system: Any,
    *,
    quantity: Callable[[StateSpace], float] | None = None,
    count: int = 1000,
    seed: int = 0,
    confidence: float = 0.95,
    executor: Executor | None = None,
) -> MonteCarlo:
    """A quantity of random members of an uncertain system.

    Parameters
    ----------
    system
        An `UncertainSystem`, or an object that stands for one.
    quantity
        A function from a member, a StateSpace, to a number; None: its largest gain over frequency,
        which is infinite for an unstable member; the proven worst-case gain is then given too.
    count, seed
        Members number 0 to count - 1 of this seed; the same in any number of processes.
    confidence
        Confidence of the intervals of quantiles and shares.
    executor
        Executor that computes the members, such as that of `workbench.connect`; None: this process.

    Raises
    ------
    InputError
        The system has no uncertain element, an argument is out of its range, or the quantity of a
        member is no number.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import monte_carlo
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> found = monte_carlo(closed, count=20)
    >>> found.values.shape, bool(found.values.max() <= found.bound)
    ((20,), True)
    """
    found = uncertain(system, "system")
    if not found.elements:
        raise InputError("the system has no uncertain element; all its members are the same")
    need_count("count", count, MOST_MEMBERS)
    need_whole(seed, "seed")
    _need_share(confidence, "confidence")
    if quantity is not None and not callable(quantity):
        raise InputError(f"quantity is {quantity!r}; a function of a system is needed")
    of = partial(_value, found, quantity or largest_gain, int(seed))
    where = executor or InProcess()
    values = np.array(spread(of, range(count), where, description="random members", batch=BATCH))
    bound = math.nan
    if quantity is None and worst_pole(found.nominal)[1] < 0:
        bound = worst_case_gain(found, tolerance=BOUND_TOLERANCE).upper
    name = "largest gain" if quantity is None else getattr(quantity, "__name__", "quantity")
    return MonteCarlo(values, name.strip("<>"), float(confidence), bound)


def largest_gain(member: StateSpace) -> float:
    """The H-infinity norm; infinite for an unstable system."""
    import control

    return math.inf if worst_pole(member)[1] >= 0 else float(control.linfnorm(member)[0])


def _value(
    system: UncertainSystem, quantity: Callable[[StateSpace], float], seed: int, number: int
) -> float:
    (member,) = system.sample(1, seed=(seed, number))
    try:
        found = quantity(member)
    except WorkbenchError:
        raise
    except Exception as error:
        raise InputError(
            f"the quantity of member {number} raised {type(error).__name__}: {error}"
        ) from error
    if not is_real(found) or math.isnan(found):
        raise InputError(f"the quantity of member {number} is {found!r}; a number is needed")
    return float(found)


def _need_share(value: Any, name: str) -> None:
    if not is_real(value) or not 0.0 < value < 1.0:
        raise InputError(f"{name} is {value!r}; a number between 0 and 1 is needed")
