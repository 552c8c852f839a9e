"""Compare a stored comparison with its stored cells, and a sweep with its points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.bench.cells.record import CELL, Record, certified_gap
from workbench.bench.cells.stored import light_records
from workbench.bench.compare import asked_for
from workbench.bench.comparison.layout import cell_labels
from workbench.bench.comparison.numbers import counts
from workbench.bench.comparison.verdicts import judged_cells
from workbench.bench.results import Run, root_of
from workbench.bench.store import Store
from workbench.solvers import Outcome

CHANGING = {Outcome.TIME_LIMIT, Outcome.MEMORY_LIMIT, Outcome.CRASHED}
"""Outcomes that may differ on another machine."""


def cell_of(run: Run) -> list[str]:
    """Disagreements between the record in a cell's folder and the cell's certificate."""
    if CELL not in run.info:
        return []
    record, gap = Record.stored(run), certified_gap(run.certificate)
    if np.isnan(gap):
        return [] if np.isnan(record.gap) else [f"run.json says gap {record.gap}, and has none"]
    return [] if _same(record.gap, gap) else ["run.json: another gap than certified"]


def _same(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-9) or (math.isnan(a) and math.isnan(b))


Place = tuple[int, ...]
"""Indices of a cell in the arrays of a comparison."""


def stored_cells(
    run: Run, faults: Callable[[Path], Sequence[str]]
) -> tuple[list[str], list[str], list[Place]]:
    """Disagreements between a comparison and those of its cells that are stored beside it.

    ``faults`` verifies the folder of a cell: a table is only as good as its cells. Also returned
    are notes, and the cells without a folder, whose answers cannot be certified.

    A cell that other code has answered since, such as an edited method, counts as another cell.
    """
    data, store, light = run.data, Store(root_of(run)), light_records(root_of(run))
    asked, wrong, missing, replaced = _asked_places(data), [], 0, 0
    without: list[Place] = []
    for place in asked:
        key, problem = str(data["key"].values[place]), str(data["problem"].values[place[0]])
        folders = [Run(one) for one in store.places(problem, key) if one.exists()]
        found = [(str(one.info["code"]), Record.stored(one)) for one in folders]
        found += [light[key]] if key in light else []
        own = str(data["code"].values[place]) if "code" in data else None
        records = [record for code, record in found if own in (code, None)]
        missing += not found
        replaced += bool(found) and not records
        for record in records:
            wrong += [f"{key}: {text}" for text in _record_differences(record, data, place)]
        answered = [one.path for one in folders if own in (str(one.info["code"]), None)]
        wrong += [f"{key}: {text}" for path in answered for text in faults(path)]
        without += [] if answered else [place]
    notes = [
        f"{count} of {len(asked)} cells {what}; --rerun answers them anew"
        for count, what in (
            (missing, "are not here"),
            (replaced, "were answered again since, by other code"),
        )
        if count
    ]
    return wrong, notes, without


def _asked_places(data: Dataset) -> list[Place]:
    """Indices of the cells that were asked."""
    return [tuple(place) for place in np.argwhere(data["key"].values != "").tolist()]


def _record_differences(record: Record, data: Dataset, place: Place) -> Iterator[str]:
    for name in ("outcome", "claim", "objective", "gap", "statement", "solve", "cpu"):
        own, here = getattr(record, name), data[name].values[place]
        same = own == here if isinstance(own, str) else _same(float(own), float(here))
        if not same:
            yield f"its {name} is {own}, the comparison says {here}"


def rerun_cells(run: Run, places: Sequence[Place] | None = None) -> tuple[list[str], list[str]]:
    """Cells that end differently when they are computed again; and notes. Nothing is stored.

    ``places``: the cells to judge; None: all. A bound that was certified then must not exclude an
    answer that is certified now, or the other way round.
    """
    asked, data = run.info["parameters"], run.data
    places = _asked_places(data) if places is None else places
    problems = [str(data["problem"].values[place[0]]) for place in places]
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
        problems=tuple(dict.fromkeys(problems)),
        light=True,
        fresh=True,
        kept=False,
    )
    texts = {str(name): "" for name, one in data.data_vars.items() if one.dtype.kind in "OSUT"}
    again = comparison().reindex_like(data, fill_value=texts)
    wrong = _excluded(data, again)
    notes: list[str] = []
    for place in places:
        was, now = (str(one["outcome"].values[place]) for one in (data, again))
        if was != now:
            name = " ".join(cell_labels(data, place))
            sentence = f"re-run: {name}: {now}, it was {was}"
            (notes if CHANGING & {was, now} else wrong).append(sentence)
    return wrong, notes


def _excluded(data: Dataset, again: Dataset) -> list[str]:
    """Pairs of stored and new certificates that exclude each other."""
    import xarray as xr

    renamed = again.assign_coords(repetition=again["repetition"] + data.sizes["repetition"])
    both = xr.concat([data, renamed], "repetition", data_vars="minimal", coords="minimal")
    found = (
        counts(judged_cells(both))["contradictions"] - counts(judged_cells(data))["contradictions"]
    )
    return [f"re-run: {found} certificates exclude stored ones, or the other way round"] * (
        found > 0
    )


def stored_points(run: Run, faults: Callable[[Path], Sequence[str]]) -> tuple[list[str], list[str]]:
    """Disagreements between a sweep and those of its points that are stored; and notes.

    ``faults`` verifies the folder of a point.
    """
    store, data = Store(root_of(run)), run.data
    problem, wrong, missing = str(data.attrs["problem"]), [], 0
    keys = data["key"].values
    asked = [place for place in np.ndindex(*keys.shape) if keys[place]]
    for place in asked:
        folders = [one for one in store.places(problem, str(keys[place])) if one.exists()]
        missing += not folders
        for folder in folders:
            wrong += [f"{folder.name}: {text}" for text in _point_apart(Run(folder), data, place)]
            wrong += [f"{folder.name}: {text}" for text in faults(folder)]
    notes = [f"{missing} of {len(asked)} points are not here; run the sweep again"]
    return wrong, notes if missing else []


def _point_apart(run: Run, data: Dataset, place: tuple[int, ...]) -> Iterator[str]:
    outcome = str(data["outcome"].values[place])
    if run.outcome != outcome:
        yield f"its outcome is {run.outcome}, the sweep says {outcome}"
    for name, value in run.metrics.items():
        stored = f"metric_{name}" if f"metric_{name}" in data else name
        if stored not in data or not _same(float(value), float(data[stored].values[place])):
            yield f"its {name} is {value}, the sweep says otherwise"
