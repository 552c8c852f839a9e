"""Numbers of runs under other readings, stored as a table.

A row has the key of its run, with which `workbench run <problem> --set ...` makes the run again.
The table is written by `make readings`; the reference results hold only the runs of the natural
reading.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from workbench import Run

from .assignments import TABLES, asked, assignments, changes, natural, settable
from .chapters import numbers
from .intervals import Measured
from .items import Found, Quantity

FILE = TABLES / "summaries.csv"
SHORTER: dict[str, dict[str, Any]] = {
    "gain-ramp": {"draws": 1},
    "diode-plane": {"draws": 1, "defects": 4},
    "position-estimator": {"draws": 10},
    "open-loop": {"draws": 6},
    "closed-loop": {"draws": 4},
    "excursion": {"draws": 6},
    "linearity": {"draws": 2},
    "optical-gain": {"draws": 2},
    "strategies": {"draws": 4},
}
"""Parameters that make runs under another reading shorter than the reference results."""
ONE_CHANGE = (
    "bandwidth-trade-off",
    "best-gains",
    "excursion",
    "false-detections",
    "strategies",
    "wrong-rotation",
)
"""Problems with tens or hundreds of readings, each of which takes a minute or more: only readings
that change one answer are run.
"""
Key = tuple[str, str, str]
"""Problem, its parameters as JSON, and the quantity."""


@dataclass(frozen=True)
class Summary:
    """A number of a run under another reading.

    checks: checks of the run's certificate that do not hold. A run that fails checks under another
    reading still shows its numbers.
    """

    problem: str
    parameters: str
    key: str
    checks: str
    quantity: str
    value: float
    low: float
    high: float


class Made(NamedTuple):
    """A stored run: the parameters with which its problem is run, and its key."""

    problem: str
    parameters: tuple[tuple[str, Any], ...]
    key: str


def words(parameters: Mapping[str, Any]) -> str:
    """Parameters of a run, as one text."""
    return json.dumps(dict(parameters), sort_keys=True)


@cache
def stored() -> dict[Key, Found]:
    """Numbers of the table."""
    return {
        (one.problem, one.parameters, one.quantity): Found(one.value, one.low, one.high)
        for one in read()
    }


@cache
def runs() -> dict[tuple[str, str], Made]:
    """Runs of the table, by the problem and its parameters as JSON."""
    return {
        (one.problem, one.parameters): Made(
            one.problem,
            tuple({**json.loads(one.parameters), **shorter(one.problem)}.items()),
            one.key,
        )
        for one in read()
    }


def read() -> list[Summary]:
    """Rows of the table."""
    with FILE.open(encoding="utf-8", newline="") as lines:
        return [
            Summary(*row[:5], *map(float, row[5:]))  # type: ignore[arg-type]
            for row in list(csv.reader(lines))[1:]
        ]


def wanted() -> dict[tuple[str, str], tuple[dict[str, Any], dict[str, Quantity]]]:
    """Runs under other readings that the ledger needs, and the quantities that are read
    from each.
    """
    found: dict[tuple[str, str], tuple[dict[str, Any], dict[str, Quantity]]] = {}
    for number in numbers():
        for own in assignments([*settable(number.run), *number.quantity.variables]):
            reading = natural() | own
            parameters = asked(number.run, reading, number.told)
            if parameters and (changes(own) == 1 or not one_change(number.run)):
                _, quantities = found.setdefault((number.run, words(parameters)), (parameters, {}))
                quantity = number.quantity.under(reading)
                quantities[str(quantity)] = quantity
    return found


def one_change(problem: str) -> bool:
    """Whether only readings that change one answer are run with a problem."""
    return problem.rpartition("/")[2] in ONE_CHANGE


def shorter(problem: str) -> dict[str, Any]:
    """Parameters that make a problem's runs under another reading shorter."""
    return SHORTER.get(problem.rpartition("/")[2], {})


def made(run: Callable[[str, Mapping[str, Any]], Run | None]) -> Iterator[Summary]:
    """Rows of all wanted runs; `run` returns the run of a problem, or None."""
    for (problem, text), (parameters, quantities) in wanted().items():
        one = run(problem, {**parameters, **shorter(problem)})
        if one is not None:
            yield from rows(one, problem, text, quantities.values())


def rows(run: Run, problem: str, text: str, quantities: Iterable[Quantity]) -> Iterator[Summary]:
    """Rows of one run."""
    assert run.certificate is not None
    failed = ", ".join(check.name for check in run.certificate.checks if not check.holds)
    measured = Measured(run)
    for quantity in quantities:
        found = measured.found(quantity)
        yield Summary(problem, text, run.key, failed, str(quantity), *found)


def write(summaries: Iterable[Summary]) -> None:
    """Write the table."""
    names = list(Summary.__dataclass_fields__)
    with FILE.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(names)
        for one in sorted(summaries, key=lambda one: (one.problem, one.parameters, one.quantity)):
            told = vars(one)
            ends = [f"{told[name]:.6g}" for name in ("value", "low", "high")]
            writer.writerow([*(told[name] for name in names[:5]), *ends])
