"""Items of the ledger: what the thesis says, the numbers that were found, and the verdict.

Place names are sections, equations, tables and figures of E. Vidal Sanchez, Robust and Fault
Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from workbench import Run

Value = str | Callable[[Run], float]
"""A metric of a run by name, or what is read from its arrays."""


class Verdict(StrEnum):
    """What became of a statement of the thesis."""

    REPRODUCED = "reproduced"
    READING = "reproduced under a stated reading"
    REFUTED = "refuted"
    NOT_COMPUTABLE = "not computable"
    OPEN = "open"

    @property
    def needs_numbers(self) -> bool:
        """Whether the verdict is held by numbers."""
        return self not in (Verdict.NOT_COMPUTABLE, Verdict.OPEN)


@dataclass(frozen=True)
class Number:
    """A number of a stored run, and the limits between which the verdict stands.

    ``run`` is a problem's name; ``printed`` is what the thesis says of the number, if it does.
    """

    what: str
    run: str
    value: Value
    low: float = -math.inf
    high: float = math.inf
    printed: float | None = None

    def of(self, run: Run) -> float:
        """The number in a run. Raises KeyError for a metric that the run does not have."""
        return run.metrics[self.value] if isinstance(self.value, str) else float(self.value(run))

    def beyond(self, value: float) -> float:
        """How far a value lies beyond the limits, over their size; 0 or less within them."""
        ends = [abs(end) for end in (self.low, self.high) if math.isfinite(end)]
        size = max([*ends, math.ulp(0.0)])
        beyond = max(self.low - value, value - self.high) / (size if any(ends) else 1.0)
        return math.inf if math.isnan(beyond) else beyond


@dataclass(frozen=True)
class Item:
    """A statement of the thesis.

    ``says`` and ``found`` are in our own words; ``found`` gives the reading, the reason, or what is
    needed; ``shown`` names the table or figure that shows it.
    """

    place: str
    says: str
    verdict: Verdict
    numbers: tuple[Number, ...] = ()
    found: str = ""
    shown: str = ""


def near(what: str, run: str, value: Value, printed: float, within: float) -> Number:
    """A number that the thesis prints, and that is found within a relative distance of it."""
    off = within * abs(printed)
    return Number(what, run, value, printed - off, printed + off, printed)


def at_most(what: str, run: str, value: Value, high: float, printed: float | None = None) -> Number:
    """A number that is at most a limit."""
    return Number(what, run, value, high=high, printed=printed)


def at_least(what: str, run: str, value: Value, low: float, printed: float | None = None) -> Number:
    """A number that is at least a limit."""
    return Number(what, run, value, low=low, printed=printed)
