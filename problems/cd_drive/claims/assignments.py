"""Questions that the text of the thesis leaves open, as variables, and assignments of values to
them.

A reading of the thesis is one complete assignment, which holds for all items of the ledger. The
variables and their values are in tables/readings.toml and were fixed before the runs.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

TABLES = Path(__file__).parent / "tables"
Assignment = Mapping[str, str]
"""Values of variables, by name of the variable."""


@dataclass(frozen=True)
class Setting:
    """The parameter that sets a variable in the runs of problems.

    problems: patterns of names. stored: the value with which the reference result was made.
    """

    problems: tuple[str, ...]
    parameter: str
    stored: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Variable:
    """A question that the text leaves open.

    values: each with its meaning; the natural one is first. touches: patterns of the problems whose
    numbers depend on the variable, whether or not they can be run with another value. spares:
    exceptions from these patterns.
    """

    name: str
    question: str
    values: Mapping[str, str]
    settings: tuple[Setting, ...]
    touches: tuple[str, ...]
    spares: tuple[str, ...]

    @property
    def natural(self) -> str:
        """The value that a reader assumes without further information."""
        return next(iter(self.values))

    def setting(self, problem: str) -> Setting | None:
        """The setting by which a problem is run with the variable; None if it cannot be."""
        return next((one for one in self.settings if _fits(problem, one.problems)), None)

    def touching(self, problem: str) -> bool:
        """Whether numbers of a problem depend on the variable."""
        touched = _fits(problem, self.touches) and not _fits(problem, self.spares)
        return touched or self.setting(problem) is not None


@cache
def of_problem(problem: str) -> dict[str, Setting | None]:
    """Variables on which numbers of a problem depend, each with its setting, or None."""
    return {
        name: one.setting(problem) for name, one in variables().items() if one.touching(problem)
    }


def settable(problem: str) -> list[str]:
    """Variables that a problem's parameters can set."""
    return [name for name, setting in of_problem(problem).items() if setting is not None]


def _fits(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatch(name, one) for one in patterns)


@cache
def variables() -> dict[str, Variable]:
    """The variables by name."""
    table = tomllib.loads((TABLES / "readings.toml").read_text(encoding="utf-8"))
    return {name: _variable(name, one) for name, one in table["variables"].items()}


def _variable(name: str, row: Mapping[str, Any]) -> Variable:
    settings = tuple(
        Setting(
            tuple(one["problems"]),
            one["parameter"],
            one["stored"],
            {value: one.get("values", {}).get(value, value) for value in row["values"]},
        )
        for one in row.get("settings", ())
    )
    touches, spares = (tuple(row.get(each, ())) for each in ("touches", "spares"))
    return Variable(name, row["question"], row["values"], settings, touches, spares)


def natural() -> dict[str, str]:
    """The natural reading."""
    return {name: one.natural for name, one in variables().items()}


def assignments(names: Iterable[str]) -> Iterator[dict[str, str]]:
    """Every assignment of values to some variables; the natural one is first."""
    chosen = [name for name in variables() if name in set(names)]
    for values in product(*(variables()[name].values for name in chosen)):
        yield dict(zip(chosen, values, strict=True))


def changes(reading: Assignment) -> int:
    """Number of answers by which a reading, or a part of one, differs from the natural one."""
    return sum(value != variables()[name].natural for name, value in reading.items())


def asked(problem: str, reading: Assignment, told: Iterable[str] = ()) -> dict[str, Any] | None:
    """Parameters of the run that shows a problem under a reading; empty for the reference result.

    told: variables whose values can all be read from a single run. None if another variable affects
    the problem, does not have its natural value, and no parameter sets it.
    """
    parameters = {}
    for name, setting in of_problem(problem).items():
        if setting is not None:
            if setting.values[reading[name]] != setting.values[setting.stored]:
                parameters[setting.parameter] = setting.values[reading[name]]
        elif name not in told and reading[name] != variables()[name].natural:
            return None
    return parameters
