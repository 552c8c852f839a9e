"""What a stored comparison says of its cells, against the cells themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.bench.cells.record import CELL, Record
from workbench.bench.compare import asked_for
from workbench.bench.comparison import METHOD
from workbench.bench.results import Run, root_of
from workbench.bench.store import FAILED, Store
from workbench.certificate import Certificate
from workbench.heavy_types import Dataset
from workbench.solvers import Outcome

CHANGING = {Outcome.TIME_LIMIT, Outcome.MEMORY_LIMIT, Outcome.CRASHED}
"""Outcomes that another machine may not repeat."""


def cell_of(run: Run) -> list[str]:
    """Where the record of a cell's folder disagrees with its certificate."""
    if CELL not in run.info:
        return []
    record, certificate = Record.stored(run), run.certificate
    if certificate is None:
        return [] if np.isnan(record.gap) else [f"run.json says gap {record.gap}, and has none"]
    return [] if _same(record.gap, _gap(certificate)) else ["run.json: another gap than certified"]


def _gap(certificate: Certificate) -> float:
    return np.nan if certificate.gap is None else certificate.gap.value


def _same(a: float, b: float) -> bool:
    return a == b or (np.isnan(a) and np.isnan(b)) or abs(a - b) <= 1e-9 * abs(b)


def stored_cells(run: Run) -> tuple[list[str], list[str]]:
    """Where a comparison disagrees with those of its cells that are stored beside it; and notes."""
    store, data = Store(root_of(run)), run.data
    wrong, found, asked = [], 0, 0
    for place in _asked(data):
        key, problem = str(data["key"].values[place]), str(data["problem"].values[place[0]])
        asked += 1
        folder = store.folder(problem, key)
        for cell in (folder, folder.with_name(folder.name + FAILED)):
            if cell.exists():
                found += 1
                wrong += [
                    f"{cell.name}: {text}" for text in _apart(Record.stored(Run(cell)), data, place)
                ]
    notes = [f"{asked - found} of {asked} cells are not here; --rerun answers them anew"]
    return wrong, notes if found < asked else []


def _asked(data: Dataset) -> Iterator[tuple[int, ...]]:
    """Places of the cells that were asked."""
    for place in np.ndindex(*data["key"].shape):
        if data["key"].values[place]:
            yield place


def _apart(record: Record, data: Dataset, place: tuple[int, ...]) -> Iterator[str]:
    for name in ("outcome", "claim", "objective", "gap", "statement", "solve", "cpu"):
        own, here = getattr(record, name), data[name].values[place]
        same = own == here if isinstance(own, str) else _same(float(own), float(here))
        if not same:
            yield f"its {name} is {own}, the comparison says {here}"


def rerun_cells(run: Run) -> tuple[list[str], list[str]]:
    """Where cells answered anew, and kept nowhere, end otherwise; and notes."""
    asked, data = run.info["parameters"], run.data
    settings: dict[str, Any] = {name: asked[name] for name in ("repeat", "memory_limit")}
    settings |= {name: run.info["options"][name] for name in ("time_limit", "seed")}
    comparison = replace(
        asked_for(
            asked["pattern"],
            asked["methods"],
            asked["accuracies"],
            asked["parameters"],
            slow=True,
            **settings,
        ),
        problems=tuple(asked["problems"]),
        light=True,
        fresh=True,
        kept=False,
    )
    again = comparison().reindex_like(data, fill_value={"outcome": ""})
    wrong: list[str] = []
    notes: list[str] = []
    for place in _asked(data):
        was, now = (str(one["outcome"].values[place]) for one in (data, again))
        if was != now:
            labels = (data["problem"], data[METHOD], data["accuracy"])
            name = " ".join(str(a.values[i]) for a, i in zip(labels, place, strict=False))
            sentence = f"re-run: {name}: {now}, it was {was}"
            (notes if CHANGING & {was, now} else wrong).append(sentence)
    return wrong, notes
