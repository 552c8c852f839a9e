"""The ledger of the thesis: every statement that can be judged, and the verdict on it.

Section, equation, table and figure numbers are those of E. Vidal Sanchez, Robust and Fault Tolerant
Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, figures, problem, ref
from workbench.arrays import RealArray
from workbench.bench.declare import Ref
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.study import Study, array, figure, metric, table
from workbench.tables import markdown

from .chapters import CHAPTERS
from .items import Item, Number, Verdict

INTRODUCTION = (
    "E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003), item by item, in "
    "our words. Numbers are those of the committed reference results; each verdict is a check that "
    "stands while they stay between its limits. The page is made by `make thesis`."
)
"""What stands at the head of the page."""
COLOURS = {
    Verdict.REPRODUCED: figures.GREEN,
    Verdict.READING: figures.SKY,
    Verdict.REFUTED: figures.ORANGE,
    Verdict.NOT_COMPUTABLE: "0.75",
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
"""Random experiments whose number of draws is asked for."""
STORED = 1e-12
"""Relative difference of a number from that of its run, by rounding."""


def sources() -> list[str]:
    """Names of the problems that numbers of the ledger come from, in order."""
    return sorted({number.run for _, item in items() for number in item.numbers})


def items() -> Iterator[tuple[str, Item]]:
    """Every item with its chapter."""
    return ((chapter, item) for chapter, every in CHAPTERS.items() for item in every)


def needs(draws: int = 50, **_: Any) -> dict[str, list[Ref]]:
    """Every run that a number comes from, random experiments of so many draws."""
    return {
        "runs": [
            ref(name, draws=draws) if name.rpartition("/")[2] in REPEATED else ref(name)
            for name in sources()
        ]
    }


def counted() -> dict[Verdict, int]:
    """Number of items of each verdict."""
    every = [item.verdict for _, item in items()]
    return {one: every.count(one) for one in Verdict}


@problem("cd/claims", needs=needs, slow=True)
def claims(runs: list[Run], draws: Annotated[int, Field(ge=1, le=1000)] = 50) -> Ledger:
    """What the thesis says, item by item, and the verdict that stored results give on it.

    Each verdict is a check: it stands while the numbers of the runs stay between its limits. In an
    empty results folder it runs all that it needs, which takes hours.

    draws: of the random experiments that are compared over draws.
    """
    return Ledger({run.problem: run for run in runs})


@dataclass(frozen=True, eq=False)
class Ledger(Study):
    """The numbers of every item, from the runs that they name."""

    runs: dict[str, Run]

    headline: ClassVar[str] = "reproduced"

    @property
    def quantifier(self) -> str:
        return "for the stored runs"

    @cached_property
    def numbers(self) -> list[Number]:
        """The numbers of all items, in order."""
        return [number for _, item in items() for number in item.numbers]

    @array("number")
    def value(self) -> RealArray:
        return np.array([number.of(self.runs[number.run]) for number in self.numbers])

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        now, stored = self.value_now, answer["value"].values
        off = np.abs(now - stored) / np.maximum(np.abs(stored), np.finfo(float).tiny)
        same = "largest relative difference of a number from that of its run"
        return [Check("runs", same, float(off.max()), STORED), *self._verdicts(stored)]

    @property
    def value_now(self) -> RealArray:
        """The numbers as the runs give them."""
        return np.array([number.of(self.runs[number.run]) for number in self.numbers])

    def _verdicts(self, stored: RealArray) -> Iterator[Check]:
        """A check for each verdict that numbers hold."""
        values = iter(stored.tolist())
        for chapter, item in items():
            beyond = [(number.beyond(next(values)), number.what) for number in item.numbers]
            if beyond:
                worst, what = max(beyond)
                statement = f"{item.says}: {item.verdict}; how far a number is beyond its limits"
                yield Check(f"{chapter}: {item.place}", statement, worst, 0.0, what)

    @metric
    def by_verdict(self) -> dict[str, float]:
        """Number of items of each verdict."""
        counts = {str(one).replace(" ", "_"): float(n) for one, n in counted().items()}
        return counts | {"items": sum(counts.values())}

    @table
    def ledger(self, value: DataArray) -> dict[str, str]:
        """A table of each chapter."""
        values, tables = iter(value.values.tolist()), {}
        for chapter, every in CHAPTERS.items():
            rows = [_row(item, [next(values) for _ in item.numbers]) for item in every]
            name = chapter.lower().replace(" ", "-")
            tables[name] = markdown(["place", "the thesis says", "found", "verdict"], rows)
        return tables

    def page(self, answer: Dataset) -> str:
        """The ledger as one page in Markdown."""
        told = ", ".join(f"{count} {verdict}" for verdict, count in counted().items())
        parts = [f"# What the thesis says, and what became of it\n\n{INTRODUCTION}\n\n{told}.\n"]
        for chapter, table_ in zip(CHAPTERS, self.tables(answer).values(), strict=True):
            parts.append(f"## {chapter}\n\n{table_}")
        return "\n".join(parts)

    @figure
    def verdicts(self, answer: Dataset) -> Figure:
        """Verdicts of each chapter."""
        drawn, (panel,) = figures.axes(size=(8.0, 4.0))
        names, before = list(CHAPTERS), np.zeros(len(CHAPTERS))
        for verdict in Verdict:
            count = np.array(
                [sum(i.verdict is verdict for i in every) for every in CHAPTERS.values()]
            )
            panel.barh(names, count, left=before, color=COLOURS[verdict], label=str(verdict))
            before = before + count
        panel.invert_yaxis()
        figures.label(panel, "items", "", "What the thesis says")
        figures.legend_below(drawn, panel)
        return drawn


def _row(item: Item, values: list[float]) -> list[Any]:
    """Cells of an item: where, what is said, what was found, the verdict."""
    pairs = zip(item.numbers, values, strict=True)
    found = [f"{number.what} {value:.4g}{_printed(number)}" for number, value in pairs]
    runs = sorted({number.run for number in item.numbers})
    words = [one for one in (item.found, "; ".join(found)) if one]
    where = ", ".join([*runs, *filter(None, [item.shown])])
    text = ". ".join(words) + (f" ({where})" if where else "")
    return [item.place, item.says, text, str(item.verdict)]


def _printed(number: Number) -> str:
    return "" if number.printed is None else f" (printed {number.printed:.4g})"
