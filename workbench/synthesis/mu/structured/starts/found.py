"""The starts of method "fixed": the best of the starts that all rules find."""

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
"""Largest number of starts of a rule, least relative distance of their peaks, and largest number of
starts in all.
"""
MOST_SEARCHED = 4
"""Number of results of the search for the rightmost pole that are compared."""

Rule = Callable[[Search], Iterable[StateSpace]]

FULL_ORDER = "a full-order controller, reduced"
LAGS = "the rules for lags with dead time (SIMC)"
QUIET = "zero or a little integration"
RULES: dict[str, Rule] = {
    QUIET: quiet,
    LAGS: lag_rules,
    FULL_ORDER: full_order_starts,
}
"""Rules by their names in messages, cheap ones first."""
OF_AN_ORDER = (QUIET, FULL_ORDER)
"""The rules used for controllers of an order."""
GAINS = "the ranges of stabilising gains"
RIGHTMOST = "a search for the rightmost pole"


class NoStabilisingGainError(SolverError):
    """No constant gain stabilises the plant, as exact arithmetic with fractions shows."""


def found_starts(program: MuSynthesis, context: Context) -> list[Start]:
    """Members that stabilise and meet the demands, by increasing peak.

    If neither a rule for lags nor a full-order controller gives a start, a search for the rightmost
    pole is used too. Descents from different starts end at different points.

    Raises
    ------
    NoStabilisingGainError
        A constant gain is demanded, but none stabilises.
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
        found += _starts_of_rule(search, name, rule, found)
        if any(program.target and one.peak <= program.target for one in found):
            break
    if GAINS in asked and not found and none_stabilises(search):
        raise NoStabilisingGainError("no gain stabilises")
    last: dict[str, Rule] = {LAGS: lag_rules, RIGHTMOST: _rightmost_results}
    if not any(one.rule != QUIET for one in found):
        for name in [name for name in last if name not in asked]:
            found += _starts_of_rule(search, name, last[name], found)
    if not found:
        raise SolverError(_failure_message(search, [*asked, RIGHTMOST]))
    return sorted(found, key=lambda one: one.peak)[:IN_ALL]


def _need_demands_met(search: Search) -> None:
    """Raise InputError if no member can be as stable or as slow as demanded."""
    examples = [K for each in search.corners for K in search.family.examples(each, search.gain)]
    demands = search.program.demands.without_gain
    if not examples or any(demands.admits(K) for K in examples):
        return
    failed = [c for c in demands.checks(examples[-1]) if not c.holds]
    raise InputError(
        f"no member of {search.family} meets the demands on the controller: "
        f"{'; '.join(c.name for c in failed)}. An integrator is not stable: give it a leak "
        "[rad/s]; a fixed filter is a pole of size 1 / filter"
    )


def _starts_of_rule(search: Search, name: str, rule: Rule, before: list[Start]) -> list[Start]:
    """The best different starts of a rule; none if time is up and there are other starts."""
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
    return _best_different(search, name, good)


def _best_different(search: Search, name: str, controllers: list[StateSpace]) -> list[Start]:
    """The different controllers with the least peaks."""
    found: list[Start] = []
    least = 0.0
    peaks: list[tuple[float, int]] = []
    for place, K in enumerate(controllers):
        if peaks and search.context.late:
            break
        try:
            peaks.append((search.peak(K), place))
        except InputError:  # a controller of an order whose modes cannot form a block
            continue
    for peak, place in sorted(peaks):
        if peak > (1 + ALIKE) * least and len(found) < OF_A_RULE:
            found.append(Start(controllers[place], name, peak))
            least = peak
    return found


def _rightmost_results(search: Search) -> Iterator[StateSpace]:
    """The first stabilising results of the search for the rightmost pole."""
    return islice((K for K in rightmost(search) if search.stabilises(K)), MOST_SEARCHED)


def _failure_message(search: Search, tried: list[str]) -> str:
    """The error message: what was tried without success, and what to do."""
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
