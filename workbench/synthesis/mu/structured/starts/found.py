"""The starts of method "fixed": every rule is asked, and the best of what they find are kept."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError, SolverError, TimeLimitError
from workbench.executor import Context
from workbench.synthesis.families.modal import Modal
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.mu.structured.starts.full_order import full_order_starts
from workbench.synthesis.mu.structured.starts.gains import gain_starts, none_stabilises, one_gain
from workbench.synthesis.mu.structured.starts.lag_rules import lag_rules
from workbench.synthesis.mu.structured.starts.quiet import quiet
from workbench.synthesis.mu.structured.starts.rightmost import SEARCHES, rightmost
from workbench.synthesis.mu.structured.starts.search import Search, Start

OF_A_RULE, ALIKE, IN_ALL = 3, 0.02, 8
"""Most starts of a rule, the relative distance of their peaks, and most starts in all."""
MOST_SEARCHED = 4
"""Results of the search for the rightmost pole that are compared."""

Rule = Callable[[Search], Iterable[StateSpace]]

FULL_ORDER = "a full-order controller, reduced"
LAGS = "the rules for lags with dead time (SIMC)"
QUIET = "zero or a little integration"
RULES: dict[str, Rule] = {
    QUIET: quiet,
    LAGS: lag_rules,
    FULL_ORDER: full_order_starts,
}
"""Rules by what messages call them, cheap ones first."""
OF_AN_ORDER = (QUIET, FULL_ORDER)
"""The rules that controllers of an order need."""
GAINS = "the ranges of stabilising gains"
RIGHTMOST = "a search for the rightmost pole"


class NoStabilisingGainError(SolverError):
    """No constant gain stabilises the plant, which fractions tell."""


def found_starts(program: MuSynthesis, context: Context) -> list[Start]:
    """Members that stabilise and meet the demands, that of least peak first.

    Where neither a rule for lags nor a full-order controller leads to one, a search for the
    rightmost pole joins. Descent ends at other places from each.

    Raises
    ------
    NoStabilisingGainError
        A constant gain is asked for, and none stabilises.
    SolverError
        None was found.
    """
    family = program.family
    if family is None:
        assert program.order is not None
        family = Modal(program.order).sized(program.plant.measurements, program.plant.controls)
    search = Search(program, family, context)
    _need_demands_met(search)
    asked = RULES
    if one_gain(search):
        asked = {GAINS: gain_starts}
    elif isinstance(family, Modal):
        asked = {name: RULES[name] for name in OF_AN_ORDER}
    found: list[Start] = []
    for name, rule in asked.items():
        found += _of_rule(search, name, rule, found)
        if any(program.target and one.peak <= program.target for one in found):
            break
    if GAINS in asked and not found and none_stabilises(search):
        raise NoStabilisingGainError("no gain stabilises")
    last: dict[str, Rule] = {LAGS: lag_rules, RIGHTMOST: _searched}
    if not any(one.rule != QUIET for one in found):
        for name in [name for name in last if name not in asked]:
            found += _of_rule(search, name, last[name], found)
    if not found:
        raise SolverError(_failed(search, [*asked, RIGHTMOST]))
    return sorted(found, key=lambda one: one.peak)[:IN_ALL]


def _need_demands_met(search: Search) -> None:
    """Raise InputError where no member can be as stable or as slow as is asked."""
    examples = [K for each in search.corners for K in search.family.examples(each, search.gain)]
    demands = search.program.demands.without_gain
    if not examples or any(demands.admits(K) for K in examples):
        return
    failed = [c for c in demands.checks(examples[-1]) if not c.holds]
    raise InputError(
        f"no member of {search.family} meets what is asked of the controller: "
        f"{'; '.join(c.name for c in failed)}. An integrator is not stable: give it a leak "
        "[rad/s]; a fixed filter is a pole of size 1 / filter"
    )


def _of_rule(search: Search, name: str, rule: Rule, before: list[Start]) -> list[Start]:
    """The best starts of a rule that are not alike; none once time is up, if there are others."""
    context = search.context
    context.progress(f"start: {name}", 0, 1)
    good: list[StateSpace] = []
    try:
        for K in rule(search):
            context.seconds_left(f"start: {name}")
            if search.stabilises(K):
                good.append(K)
    except TimeLimitError:
        if not (before or good):
            raise
    context.progress(f"start: {name}", 1, 1)
    return _best(search, name, good)


def _best(search: Search, name: str, controllers: list[StateSpace]) -> list[Start]:
    """The controllers of least peaks that are not alike."""
    found: list[Start] = []
    least = 0.0
    peaks: list[tuple[float, int]] = []
    for place, K in enumerate(controllers):
        if peaks and search.context.late:
            break
        try:
            peaks.append((search.peak(K), place))
        except InputError:  # an order's controller whose modes have no common block
            continue
    for peak, place in sorted(peaks):
        if peak > (1 + ALIKE) * least and len(found) < OF_A_RULE:
            found.append(Start(controllers[place], name, peak))
            least = peak
    return found


def _searched(search: Search) -> Iterator[StateSpace]:
    """The first results of the search for the rightmost pole that stabilise."""
    return islice((K for K in rightmost(search) if search.stabilises(K)), MOST_SEARCHED)


def _failed(search: Search, tried: list[str]) -> str:
    """What was tried in vain, and what to do."""
    program = search.program
    met = " and meets the demands" if program.demands.asked_of_poles else ""
    kind = f"order {program.order}" if program.family is None else f"the family {search.family}"
    least = min(search.abscissas, default=np.inf)
    size = "0 rad/s up to rounding" if least <= 0 else f"{least:.4g} rad/s"
    seen = (
        f"; the least real part of a loop's rightmost pole was {size}, which must be negative"
        if search.abscissas
        else ""
    )
    return (
        f"no controller of {kind} that stabilises{met} was found by {', '.join(tried)} "
        f"({SEARCHES} searches){seen}: give a start, or a family or order with more freedom"
    )
