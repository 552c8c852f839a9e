"""Items of the ledger: what the thesis says, and the numbers that decide about it.

Place names are sections, equations, tables and figures of E. Vidal Sanchez, Robust and Fault
Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from workbench import Run

from .assignments import Assignment, of_problem, variables
from .values import VALUES


class Found(NamedTuple):
    """A number of a run, and the ends of its 99 % interval: itself where nothing is random."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Quantity:
    """What is read from a run: a metric by its name, or a function of VALUES with arguments.

    An argument "$name" is the value that the reading gives to the variable of that name.
    """

    name: str
    arguments: Mapping[str, Any] | None = None

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of the reading that the arguments name."""
        texts = [one for one in (self.arguments or {}).values() if isinstance(one, str)]
        return tuple(one[1:] for one in texts if one.startswith("$"))

    def under(self, reading: Assignment) -> Quantity:
        """The quantity with the variables of its arguments filled in."""
        if self.arguments is None:
            return self
        filled = {
            name: reading[one[1:]] if isinstance(one, str) and one.startswith("$") else one
            for name, one in self.arguments.items()
        }
        return Quantity(self.name, filled)

    def of(self, run: Run) -> float:
        """The number in a run. Raises KeyError for a metric that the run does not have."""
        if self.arguments is None:
            return float(run.metrics[self.name])
        return float(VALUES[self.name](run, **self.arguments))

    def __str__(self) -> str:
        if self.arguments is None:
            return self.name
        return f"{self.name}({json.dumps(dict(self.arguments), sort_keys=True)})"


@dataclass(frozen=True)
class Number:
    """A number of a problem's run, and the limits between which the statement is true.

    ``run`` is a problem's name; ``printed`` is what the thesis says of the number, if it does. A
    number without limits decides nothing: it is told beside the others. ``exact``: it depends
    neither on the draws of a run that has some nor on variables that no parameter of it sets.
    """

    what: str
    run: str
    quantity: Quantity
    low: float = -math.inf
    high: float = math.inf
    printed: float | None = None
    exact: bool = False

    @property
    def told(self) -> tuple[str, ...]:
        """Variables of the reading that need no other run: one run shows all of their values."""
        return tuple(variables()) if self.exact else self.quantity.variables

    def depends_on(self, name: str) -> bool:
        """Whether the number may change with a variable."""
        touching = of_problem(self.run)
        set_by_run = touching.get(name) is not None
        return (
            set_by_run or name in self.quantity.variables or (name in touching and not self.exact)
        )

    @property
    def decides(self) -> bool:
        """Whether the number has a limit."""
        return math.isfinite(self.low) or math.isfinite(self.high)

    def judge(self, found: Found) -> bool | None:
        """Whether a number is within its limits; None where its 99 % interval meets them only."""
        if self.low <= found.value <= self.high:
            return True
        outside = self.exact or found.high < self.low or found.low > self.high
        return False if outside else None


@dataclass(frozen=True)
class Item:
    """A statement of the thesis, in our words, and what is known of it beside numbers.

    found: what a reader should know of the numbers. reading: how the words are taken, where they
    could be taken otherwise. measured: the thesis measured it. built_in: where the laboratory has
    it as an input. tried: what was tried to compute it, in vain. needs: what is missing. shown: the
    table or figure that shows it.
    """

    place: str
    says: str
    numbers: tuple[Number, ...] = field(default=())
    found: str = ""
    reading: str = ""
    measured: bool = False
    built_in: str = ""
    tried: str = ""
    needs: str = ""
    shown: str = ""
