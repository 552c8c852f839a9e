"""Items of the ledger: statements of the thesis, and the numbers that decide about them.

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
    """A number of a run and the ends of its 99 % interval; without randomness all three
    are equal.
    """

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Quantity:
    """A value read from a run: a metric by its name, or a function of VALUES with arguments.

    An argument "$name" stands for the value that the reading gives to the variable of that name.
    """

    name: str
    arguments: Mapping[str, Any] | None = None

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of the reading that appear in the arguments."""
        texts = [one for one in (self.arguments or {}).values() if isinstance(one, str)]
        return tuple(one[1:] for one in texts if one.startswith("$"))

    def under(self, reading: Assignment) -> Quantity:
        """The quantity with these variables replaced by their values in the reading."""
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

    ``run`` is a problem's name. ``printed`` is the value in the thesis, if it states one. A number
    without limits decides nothing and is only shown. ``exact``: whether the number is independent
    of the draws of its run and of variables that no parameter of the run sets. ``untouched``:
    variables that parameters of the run set, and that leave this number as it is.
    """

    what: str
    run: str
    quantity: Quantity
    low: float = -math.inf
    high: float = math.inf
    printed: float | None = None
    exact: bool = False
    untouched: tuple[str, ...] = ()

    @property
    def told(self) -> tuple[str, ...]:
        """Variables of the reading whose values can all be read from one run."""
        return tuple(variables()) if self.exact else self.quantity.variables

    def depends_on(self, name: str) -> bool:
        """Whether the number may change with a variable."""
        if name in self.untouched:
            return False
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
        """Whether a number is within its limits; None if a limit is inside its 99 % interval."""
        if self.low <= found.value <= self.high:
            return True
        outside = self.exact or found.high < self.low or found.low > self.high
        return False if outside else None


@dataclass(frozen=True)
class Item:
    """A statement of the thesis, in our words, with further information about it.

    found: remarks about the numbers. reading: interpretation of the words, if they could also be
    understood otherwise. measured: whether the thesis measured it. built_in: place where the
    laboratory has it as an input. tried: attempts to compute it that failed. needs: what is
    missing. shown: table or figure that shows it.
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
