"""The cells of a comparison: one problem by one method at one accuracy level."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bench.comparison import UNFIT
from workbench.bench.project import add_problems
from workbench.bench.run import Bench
from workbench.bench.store import Store
from workbench.errors import TimeLimitError
from workbench.program import Program, methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome

COMPILED_AFTER = 20.0
"""A solve faster than this [s] is timed a second time: its first call may have compiled."""


@dataclass(frozen=True)
class Cell:
    """One problem by one method at one accuracy level."""

    outcome: str
    claim: str
    message: str
    statement: float = np.nan
    solve: float = np.nan
    gap: float = np.nan

    @property
    def success(self) -> bool:
        """The certificate holds, of an answer or of there being none."""
        return Outcome(self.outcome).proven if self.outcome != UNFIT else False

    @property
    def correct(self) -> bool:
        """The method's claim is what its certificate proves, be it the best answer or not.

        What claims nothing, or dies, is not correct; nor is a claim that nothing proves.
        """
        certified = self.success or self.outcome == Outcome.INACCURATE
        return certified and self.claim == self.outcome


def run_cell(
    name: str,
    method: str,
    parameters: Mapping[str, Any],
    options: Options,
    folders: Sequence[Path],
    results: Path,
) -> Cell:
    """Answer one cell; whatever goes wrong is in the cell."""
    for folder in folders:
        add_problems(folder)
    task = Bench(Store(results), Options(seed=options.seed)).load(name, parameters).task
    if not isinstance(task, Program):
        return Cell(UNFIT, "", f"{name} is a study: it has no methods")
    chosen = methods(task).get(method)
    reason = chosen.unfit(task) if chosen else f"{type(task).__name__} has no method {method!r}"
    if reason:
        return Cell(UNFIT, "", reason)
    solution = solve(task, method, options)
    if solution.seconds["solve"] < COMPILED_AFTER:
        solution = solve(task, method, options)
    gap = solution.certificate.gap if solution.certificate else None
    return Cell(
        solution.outcome,
        solution.claim,
        solution.message,
        solution.seconds["statement"],
        solution.seconds["solve"],
        gap.value if gap else np.nan,
    )


def result_of(future: Future[Cell]) -> Cell:
    """The cell that a worker gives, whatever became of the worker."""
    try:
        return future.result()
    except TimeLimitError as error:
        return Cell(Outcome.TIME_LIMIT, "", str(error))
    except Exception as error:  # whatever a worker, or somebody's executor, died of
        return Cell(Outcome.FAILED, "", f"{type(error).__name__}: {error}")
