"""The ledger of the thesis: every statement that can be judged, with its verdict.

Section, equation, table and figure numbers are those of E. Vidal Sanchez, Robust and Fault Tolerant
Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, figures, problem, ref
from workbench.study import Study, arrays, dim, figure, metric, part
from workbench.types import Dataset, Figure, RealArray

from . import page, summaries
from .assignments import Assignment, asked, assignments, natural, settable
from .chapters import NAMES, chapters, file_of, numbers, sources
from .intervals import Measured
from .items import Found, Item, Number, Quantity
from .numbers_page import every_number
from .verdicts import Verdict, verdict

COLOURS = {
    Verdict.BUILT_IN: "0.6",
    Verdict.NOT_COMPUTABLE: "0.75",
    Verdict.NOT_EXPLAINED: figures.PURPLE,
    Verdict.REFUTED: figures.ORANGE,
    Verdict.ALL: figures.GREEN,
    Verdict.NATURAL: figures.BLUE,
    Verdict.STATED: figures.SKY,
    Verdict.OPEN: "0.9",
}
REPEATED = (
    "after-defects",
    "bandwidth-trade-off",
    "closed-loop",
    "diode-plane",
    "disturbance-groups",
    "false-detections",
    "linearity",
    "multisine-linearity",
    "open-loop",
    "optical-gain",
    "position-estimator",
    "raised-sum",
    "residuals",
    "response-methods",
    "strategies",
    "unlike-arms",
    "wrong-rotation",
)
"""Random experiments for which the ledger asks for a number of draws."""
STORED, COMPUTED = 1e-12, 5e-10
"""Rounding errors allowed when a number is compared with that of its run, relative: of a metric,
and of what is computed from a run. The latter differs by up to 9e-11 between processors, and every
number is farther than this from its limits, unless it is a count.
"""
TABLES = ("readings.toml", "summaries.csv", "findings.toml", *map(file_of, NAMES))


def needs(draws: int = 50, **_: Any) -> dict[str, list[Any]]:
    """References to every run from which a number comes, with this number of draws for random
    experiments.
    """
    return {"runs": [ref(name, **_repeated(name, draws)) for name in sources()]}


def _repeated(name: str, draws: int) -> dict[str, Any]:
    """The parameter that gives a problem its number of draws; none where nothing is drawn."""
    return {"draws": draws} if name.rpartition("/")[2] in REPEATED else {}


@problem(
    "cd/claims",
    needs=needs,
    slow=True,
    data=tuple(f"claims/tables/{name}" for name in TABLES),
)
def claims(runs: list[Run], draws: Annotated[int, Field(ge=1, le=1000)] = 50) -> Ledger:
    """What the thesis says, item by item, and the verdict that stored results give on it.

    A reading of the thesis is one assignment of values to the questions that its text leaves open.
    The verdict on an item follows by rule from its numbers under every reading: numbers of the
    stored runs, and numbers of runs under other readings, of which summaries are stored. In an
    empty results folder everything needed is run first, which takes hours.

    draws: number of draws of the random experiments.
    """
    return Ledger({run.problem: run for run in runs})


@dataclass(frozen=True, eq=False)
class Ledger(Study):
    """The numbers of every item, from the runs that the numbers name."""

    runs: dict[str, Run]

    headline: ClassVar[str] = "reproduced"

    @property
    def quantifier(self) -> str:
        return "for the stored runs"

    @cached_property
    def asked_for(self) -> list[tuple[str, Quantity]]:
        """Every quantity of every run, once, under each reading that the stored run can show."""
        found: dict[tuple[str, str], Quantity] = {}
        for number in numbers():
            names = number.quantity.variables
            for own in assignments([*settable(number.run), *names]):
                reading = natural() | own
                if not asked(number.run, reading, number.told):
                    quantity = number.quantity.under(reading)
                    found.setdefault((number.run, str(quantity)), quantity)
        return [(run, quantity) for (run, _), quantity in found.items()]

    entry = dim(lambda self: [f"{run}: {quantity}" for run, quantity in self.asked_for])

    @part
    def found(self) -> list[Found]:
        """The quantities with their intervals."""
        measured = {name: Measured(run) for name, run in self.runs.items()}
        return [measured[run].found(quantity) for run, quantity in self.asked_for]

    ends = arrays(
        entry,
        lambda found: dict(zip(Found._fields, np.transpose(found), strict=True)),
        value="",
        low=("", "lower end of the 99 % interval"),
        high=("", "upper end of the 99 % interval"),
    )

    def lookup(self, answer: Dataset) -> Any:
        """Numbers by reading: from the stored runs, and from the summaries of other runs."""
        ends = answer[list(Found._fields)].to_array().transpose("entry", "variable").values
        own = {
            (run, str(quantity)): Found(*row)
            for (run, quantity), row in zip(self.asked_for, ends.tolist(), strict=True)
        }
        others = summaries.stored()

        def found(number: Number, reading: Assignment) -> Found | None:
            parameters = asked(number.run, reading, number.told)
            if parameters is None:
                return None
            quantity = str(number.quantity.under(reading))
            if not parameters:
                return own[number.run, quantity]
            return others.get((number.run, summaries.words(parameters), quantity))

        return found

    def run_of(self, number: Number, reading: Assignment) -> summaries.Made | None:
        """The run that shows a number under a reading; None if none is stored."""
        parameters = asked(number.run, reading, number.told)
        if parameters is None:
            return None
        if parameters:
            return summaries.runs().get((number.run, summaries.words(parameters)))
        run = self.runs[number.run]
        given = _repeated(number.run, run.info["parameters"].get("draws", 0))
        return summaries.Made(number.run, tuple(given.items()), run.key)

    def judged(self, answer: Dataset) -> dict[str, list[tuple[Item, Verdict]]]:
        """The items of each chapter with their verdicts."""
        found = self.lookup(answer)
        return {
            chapter: [(item, verdict(item, found)) for item in every]
            for chapter, every in chapters().items()
        }

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        stored = answer["value"].values
        now = np.array([quantity.of(self.runs[run]) for run, quantity in self.asked_for])
        off = _relative(now, stored)
        read = np.array([quantity.arguments is None for _, quantity in self.asked_for])
        same = "largest relative difference of a number from {} its run"
        return [
            Check("runs", same.format("that of"), float(off[read].max()), STORED),
            Check("computed", same.format("what follows from"), float(off[~read].max()), COMPUTED),
        ]

    @metric
    def by_verdict(self, answer: Dataset) -> dict[str, float]:
        """Number of items with each verdict, and of all items that are reproduced under some
        reading.
        """
        told = [one for every in self.judged(answer).values() for _, one in every]
        counts = {str(one).replace(" ", "_"): float(told.count(one)) for one in Verdict}
        reproduced = float(sum(one.reproduced for one in told))
        return counts | {"reproduced": reproduced, "items": float(len(told))}

    def page(self, answer: Dataset) -> str:
        """The ledger as a page in Markdown."""
        return page.thesis(self.judged(answer), self.lookup(answer))

    def numbers_page(self, answer: Dataset) -> str:
        """All numbers of the ledger as a page in Markdown."""
        return every_number(self.judged(answer), self.lookup(answer), self.run_of)

    @figure
    def verdicts(self, answer: Dataset) -> Figure:
        """Verdicts of each chapter."""
        drawn, (panel,) = figures.axes(1, 1, size=(8.0, 4.6))
        judged = self.judged(answer)
        names, before = list(judged), np.zeros(len(judged))
        for one in Verdict:
            count = np.array([sum(own is one for _, own in every) for every in judged.values()])
            panel.barh(names, count, left=before, color=COLOURS[one], label=str(one))
            before = before + count
        panel.invert_yaxis()
        figures.label(panel, x="items", y="", title="What the thesis says")
        figures.legend_below(drawn, panel, columns=2)
        return drawn


def _relative(now: RealArray, stored: RealArray) -> RealArray:
    """Relative differences of numbers; 0 if both are equal, or equally infinite or NaN."""
    off = np.abs(now - stored) / np.maximum(np.abs(stored), np.finfo(float).tiny)
    return np.where(now == stored, 0.0, off)
