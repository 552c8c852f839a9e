"""Every problem by every method at every accuracy level, in a results folder of its own."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bench.cells import result_of, run_cell
from workbench.bench.comparison import METHOD, Comparison
from workbench.bench.describe import describe
from workbench.bench.project import added_problems, registry, results_root
from workbench.bench.question import Question, asked, code_hash
from workbench.bench.results import COMPARISON, Run
from workbench.bench.run import Bound, default_bench
from workbench.errors import InputError, UnknownNameError
from workbench.executor import WALL_TIME, Context, InProcess, Progress, silent
from workbench.heavy_types import Dataset
from workbench.program import Program, methods
from workbench.solvers import ACCURACY, Options


@dataclass(frozen=True)
class Cells:
    """A comparison: every problem by every method at every accuracy level."""

    problems: tuple[str, ...]
    methods: tuple[str, ...]
    accuracies: tuple[str, ...]
    parameters: Mapping[str, Any]
    results: Path
    executor: Executor

    def __call__(self, context: Context) -> Dataset:
        import xarray as xr

        shape = (len(self.problems), len(self.methods), len(self.accuracies))
        options = context.options
        asked = [
            (
                self.problems[i],
                self.methods[j],
                judged(self.problems[i], self.methods[j], ACCURACY[self.accuracies[k]]),
            )
            for i, j, k in np.ndindex(*shape)
        ]
        futures = {
            (name, method, tolerance): self.executor.submit(
                run_cell,
                name,
                method,
                self.parameters,
                Options(tolerance, options.time_limit, seed=options.seed),
                added_problems(),
                self.results,
            )
            for name, method, tolerance in dict.fromkeys(asked)
        }
        # The time limit is each cell's, not the comparison's.
        watched = Context(Options(), context.progress)
        done = {one: result_of(futures[one]) for one in watched.track(list(futures), "cells")}
        cells = [done[one] for one in asked]
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
                "served": table([tolerance for _, _, tolerance in asked]),
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


def judged(problem: str, name: str, tolerance: float) -> float:
    """The tolerance that a method's answer to a problem is judged by (`Method.judging_tolerance`).

    It is the one asked for where the problem does not tell its Program without its data.
    """
    kind = registry().find(problem).hint("return")
    known = methods(kind) if inspect.isclass(kind) and issubclass(kind, Program) else {}
    return known[name].judging_tolerance(tolerance) if name in known else tolerance


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
    cells = Cells(
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
    question = Question(COMPARISON, stored, {}, {}, None, asked(options))
    bound = Bound(None, stored, {}, Comparison(cells))
    code = code_hash({registry().find(name).sources for name in names})
    with bench.store.writing(question.problem, question.key) as writer:
        return bench.answer(bound, question, code, writer)
