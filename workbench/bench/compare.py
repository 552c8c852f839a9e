"""Every problem by every method at every accuracy level, in a results folder of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench import figures
from workbench.bench.cells import UNFIT, result_of, run_cell
from workbench.bench.describe import describe
from workbench.bench.project import added_problems, registry, results_root
from workbench.bench.question import Question, asked, code_hash
from workbench.bench.results import Run
from workbench.bench.run import Bound, default_bench
from workbench.errors import InputError, UnknownNameError
from workbench.executor import WALL_TIME, Context, InProcess, Progress, silent
from workbench.program import Check, Study
from workbench.solvers import ACCURACY, Options

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

METHOD = "by_method"
"""The dimension of methods; xarray's ``sel`` keeps the word method for itself."""


@dataclass(frozen=True, eq=False)
class Comparison(Study):
    """The cells of a comparison. Its dataset has dims (problem, by_method, accuracy)."""

    problems: tuple[str, ...]
    methods: tuple[str, ...]
    accuracies: tuple[str, ...]
    parameters: Mapping[str, Any]
    results: Path
    executor: Executor

    headline = "success_rate"

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        shape = (len(self.problems), len(self.methods), len(self.accuracies))
        options = context.options
        futures = [
            self.executor.submit(
                run_cell,
                self.problems[i],
                self.methods[j],
                self.parameters,
                Options(self.accuracies[k], options.time_limit, seed=options.seed),
                added_problems(),
                self.results,
            )
            for i, j, k in np.ndindex(*shape)
        ]
        # The time limit is each cell's, not the comparison's.
        watched = Context(Options(), context.progress)
        cells = [result_of(future) for future in watched.track(futures, "cells")]
        dims = ("problem", METHOD, "accuracy")

        def table(values: list[Any], dtype: Any = float) -> tuple[Any, ...]:
            return dims, np.array(values, dtype=dtype).reshape(shape)

        return xr.Dataset(
            {
                "statement": (
                    *table([cell.statement for cell in cells]),
                    {"units": "s"} | WALL_TIME,
                ),
                "solve": (*table([cell.solve for cell in cells]), {"units": "s"} | WALL_TIME),
                "gap": (*table([cell.gap for cell in cells]), {"units": "1"}),
                "success": table([cell.success for cell in cells], "int8"),
                "correct": table([cell.correct for cell in cells], "int8"),
                "outcome": table([cell.outcome for cell in cells], str),
                "claim": table([cell.claim for cell in cells], str),
                "message": table([cell.message for cell in cells], str),
            },
            coords={
                "problem": list(self.problems),
                METHOD: list(self.methods),
                "accuracy": list(self.accuracies),
                "tolerance": ("accuracy", [ACCURACY[name] for name in self.accuracies]),
            },
        )

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        missing = int(np.sum(answer["outcome"].values == ""))
        return [Check("complete", "cells without an outcome", missing, 0)]

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
        tried = answer["outcome"].values != UNFIT
        count = max(int(tried.sum()), 1)
        return {
            "success_rate": float(answer["success"].values[tried].sum() / count),
            "correctness_rate": float(answer["correct"].values[tried].sum() / count),
            "cells": int(tried.sum()),
            "unfit": int((~tried).sum()),
        }

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        head = (
            "| problem | method | accuracy | outcome | claim | success | correct | gap "
            "| statement [s] | solve [s] |\n"
            "| --- | --- | --- | --- | --- | --- | --- | ---: | ---: | ---: |\n"
        )
        body = "".join(f"| {' | '.join(row)} |\n" for row in rows(answer))
        reasons = "".join(f"\nUnfit: {text}\n" for text in unfit(answer))
        return {"comparison": head + body + reasons}

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        return {"accuracy-against-time": accuracy_against_time(answer)}


def rows(data: xr.Dataset) -> list[list[str]]:
    """A comparison's cells as text, a row each."""
    table = []
    for i, j, k in np.ndindex(*data["outcome"].shape):
        cell = {name: data[name].values[i, j, k] for name in data.data_vars}
        unfit = cell["outcome"] == UNFIT
        labels = (data["problem"].values[i], data[METHOD].values[j], data["accuracy"].values[k])
        table.append(
            [
                *map(str, labels),
                str(cell["outcome"]),
                "-" if unfit else str(cell["claim"]),
                "-" if unfit else ("yes" if cell["success"] else "no"),
                "-" if unfit else ("yes" if cell["correct"] else "no"),
                "-" if np.isnan(cell["gap"]) else f"{cell['gap']:.1e}",
                "-" if np.isnan(cell["statement"]) else f"{cell['statement']:.4f}",
                "-" if np.isnan(cell["solve"]) else f"{cell['solve']:.4f}",
            ]
        )
    return table


def unfit(data: xr.Dataset) -> list[str]:
    """Why some methods cannot take some of the problems, a sentence each."""
    found = {}
    for i, j, k in np.ndindex(*data["outcome"].shape):
        if data["outcome"].values[i, j, k] == UNFIT:
            pair = f"{data['problem'].values[i]} by {data[METHOD].values[j]}"
            found[pair] = f"{pair}: {data['message'].values[i, j, k]}"
    return list(found.values())


def accuracy_against_time(data: xr.Dataset) -> Figure:
    """Certified gap over wall time, a panel per problem; hollow where no certificate holds."""
    names = data["problem"].values
    columns = min(2, len(names))
    lines = -(-len(names) // columns)
    figure, panels = figures.axes(
        lines, columns, size=(3.6 + 3.4 * columns, 0.8 + 3.2 * lines), sharex=True, sharey=True
    )
    floor = 1e-17  # an exact answer has no gap, a logarithmic axis no zero
    markers = dict(zip(ACCURACY, "osD", strict=True))
    for i, (panel, name) in enumerate(zip(panels, names, strict=False)):
        for j, method in enumerate(data[METHOD].values):
            colour = figures.CYCLE[j % len(figures.CYCLE)]
            seconds = (data["statement"] + data["solve"]).values[i, j]
            gap = np.maximum(data["gap"].values[i, j], floor)
            panel.plot(seconds, gap, color=colour, linewidth=0.7, alpha=0.6)
            for k, level in enumerate(data["accuracy"].values):
                held = bool(data["success"].values[i, j, k])
                panel.plot(
                    seconds[k],
                    gap[k],
                    markers[str(level)],
                    color=colour,
                    markerfacecolor=colour if held else "none",
                    label=str(method) if k == 0 else None,
                )
        if np.isfinite(data["gap"].values).any():
            panel.set_xscale("log")
            panel.set_yscale("log")
        panel.set_title(str(name))
        panel.set_xlabel("statement and solve [s]")
        panel.set_ylabel("certified gap, 0 at the bottom [relative]")
    for panel in panels[len(names) :]:
        panel.set_visible(False)
    for level in data["accuracy"].values:
        panels[0].plot([], [], markers[str(level)], color=figures.BLACK, label=str(level))
    panels[0].plot([], [], "o", color=figures.BLACK, markerfacecolor="none", label="no certificate")
    figures.legend_below(figure, panels[0], columns=8)
    return figure


def run_comparison(
    pattern: str,
    methods: Sequence[str],
    accuracies: Sequence[str],
    parameters: Mapping[str, Any],
    time_limit: float | None,
    seed: int,
    executor: Executor | None,
    progress: Progress = silent,
) -> Run:
    """See `workbench.compare`."""
    unknown = [name for name in accuracies if name not in ACCURACY]
    if unknown or not accuracies:
        raise InputError(f"accuracy levels are {', '.join(ACCURACY)}, not {unknown or 'none'}")
    if isinstance(methods, str):
        methods = [name for name in methods.split(",") if name]
    if not methods:
        raise InputError("a comparison needs at least one method")
    names = tuple(entry.name for entry in registry().match(pattern))
    known = [describe(registry().find(name)).methods for name in names]
    if all(known):  # a problem without a return annotation shows its methods only when loaded
        for name in methods:
            if not any(name in one for one in known):
                raise UnknownNameError("method", name, set().union(*known))
    for name in names:  # a wrong parameter is an error, not a table of failures
        registry().find(name).bind(parameters)
    options = Options(time_limit=time_limit, seed=seed)
    bench = default_bench(options, progress)
    comparison = Comparison(
        names,
        tuple(methods),
        tuple(accuracies),
        dict(parameters),
        results_root(),
        executor or InProcess(),
    )
    stored = {
        "pattern": pattern,
        "problems": list(names),
        "methods": list(methods),
        "accuracies": list(accuracies),
        "parameters": dict(parameters),
    }
    question = Question("compare", stored, {}, {}, None, asked(options))
    bound = Bound(None, stored, {}, comparison)
    code = code_hash({registry().find(name).sources for name in names})
    with bench.store.writing(question.problem, question.key) as writer:
        return bench.answer(bound, question, code, writer)
