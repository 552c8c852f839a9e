"""Run one problem over a grid of its parameters, and store the results as one dataset."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

from workbench._core.heavy_types import Dataset
from workbench.bench.cells.site import Site
from workbench.bench.code import code_hash
from workbench.bench.parameter_sweep import SWEEP, ParameterSweep, SweptPoint, sweep_dataset
from workbench.bench.problem import Problem
from workbench.bench.project import registry
from workbench.bench.question import Question, asked
from workbench.bench.results import Run
from workbench.bench.run import Bound, default_bench
from workbench.errors import InputError, UnknownNameError, WorkbenchError
from workbench.executor import InProcess, Progress, Workers, finished_calls, no_progress
from workbench.solvers import Options, Outcome


@dataclass(frozen=True)
class Grid:
    """The question of a sweep: a problem, its swept and fixed parameters, a method and options."""

    problem: str
    axes: Mapping[str, tuple[Any, ...]]
    parameters: Mapping[str, Any]
    method: str | None
    options: Options
    fresh: bool = False

    def __call__(self, executor: Executor, progress: Progress) -> Dataset:
        """Run the points that are not stored, and return the dataset of all points."""
        places = self.places
        calls = ((place, (_run, self.at(place), Site.here())) for place in places)
        found: dict[tuple[int, ...], SweptPoint] = {}
        progress("points", 0, len(places))
        for place, future in finished_calls(executor, calls):
            error = future.exception()
            found[place] = future.result() if error is None else _failed(error)
            progress("points", len(found), len(places))
        return sweep_dataset(self.axes, found, self.problem)

    def planned(self) -> list[tuple[tuple[Any, ...], str]]:
        """The values of each point, and whether it is "stored" or "would run"."""
        bench, found = default_bench(self.options, fresh=self.fresh), []
        for place in self.places:
            point = self.at(place).parameters
            known = bench.found(self.problem, self.method, point)
            values = tuple(point[name] for name in self.axes)
            found.append((values, "would run" if known is None else "stored"))
        return found

    @property
    def places(self) -> list[tuple[int, ...]]:
        """Every point of the grid, as the index of its value on each axis."""
        return list(itertools.product(*(range(len(values)) for values in self.axes.values())))

    def at(self, place: tuple[int, ...]) -> _Asked:
        """The run that is asked for at a point of the grid."""
        point = {name: self.axes[name][k] for name, k in zip(self.axes, place, strict=True)}
        given = {**self.parameters, **point}
        return _Asked(self.problem, given, self.method, self.options, self.fresh)


@dataclass(frozen=True)
class _Asked:
    """The run of a point, as it is sent to a worker."""

    problem: str
    parameters: Mapping[str, Any]
    method: str | None
    options: Options
    fresh: bool


def _run(question: _Asked, place: Site) -> SweptPoint:
    """Run a point; an error that prevents the run is recorded in the point."""
    place.enter()
    try:
        bench = default_bench(question.options, fresh=question.fresh)
        run = bench.run(question.problem, question.method, dict(question.parameters))
    except WorkbenchError as error:
        return _failed(error)
    seconds = run.seconds["total"]
    numbers = {name: float(value) for name, value in run.metrics.items()}
    headline = str(run.info.get("headline") or "")
    return SweptPoint(
        run.outcome, run.info["message"], run.key, run.holds, seconds, numbers, headline
    )


def _failed(error: BaseException) -> SweptPoint:
    return SweptPoint(Outcome.FAILED, f"{type(error).__name__}: {error}")


def grid_of(
    name: str,
    over: Mapping[str, Sequence[Any]],
    method: str | None,
    options: Options,
    parameters: Mapping[str, Any],
    *,
    fresh: bool = False,
) -> Grid:
    """A grid with checked names, and values checked and converted.

    Raises
    ------
    UnknownNameError, InputError
        No such problem or parameter; no values, or equal ones; a value that does not fit; or a
        parameter that is both swept and fixed.
    """
    problem = registry().find(name)
    if not over:
        raise InputError("a sweep needs a parameter and its values, such as over={'speed': [1, 2]}")
    for parameter, values in over.items():
        if parameter not in problem.parameters:
            raise UnknownNameError(f"parameter of {name}", parameter, problem.parameters)
        if parameter in parameters:
            raise InputError(f"{parameter} is swept and has a value of its own: leave out one")
        if isinstance(values, str) or not len(values):
            raise InputError(f"{parameter} needs a list of one value or more, not {values!r}")
    axes = {
        parameter: tuple(_converted(problem, parameter, value, parameters) for value in values)
        for parameter, values in over.items()
    }
    for parameter, converted in axes.items():
        if len(set(map(str, converted))) < len(converted):
            raise InputError(f"{parameter} has a value twice: {', '.join(map(str, converted))}")
    # The values cannot be compared with each other.
    for place in itertools.product(*axes.values()):
        problem.bind({**parameters, **dict(zip(axes, place, strict=True))})
    return Grid(name, axes, dict(parameters), method, options, fresh)


def _converted(problem: Problem, parameter: str, value: Any, others: Mapping[str, Any]) -> Any:
    bound = problem.bind({**others, parameter: value})
    return problem.to_json(bound)[parameter]


def run_sweep(
    grid: Grid, *, executor: Executor | None = None, jobs: int = 1, progress: Progress = no_progress
) -> Run:
    """Run the points and store the sweep's folder. See `workbench.sweep`."""
    if jobs < 1:
        raise InputError(f"jobs must be 1 or more, not {jobs}")
    with _working(executor, jobs) as where:
        data = grid(where, progress)
    axes = {name: list(values) for name, values in grid.axes.items()}
    stored: dict[str, Any] = {"problem": grid.problem, "over": axes}
    # A sweep has no method of its own, and no parameters.
    stored |= {"by": grid.method, "given": dict(grid.parameters)}
    question = Question(SWEEP, stored, {}, {}, None, asked(grid.options))
    bench = default_bench(grid.options)
    task = ParameterSweep(lambda context: data)
    with bench.store.writing(question.problem, question.key) as writer:
        bound = Bound(None, stored, {}, task)
        return bench.answer(bound, question, code_hash([type(task).__module__]), writer)


def _working(executor: Executor | None, jobs: int) -> AbstractContextManager[Executor]:
    """The executor for the points: the one given, which stays open, or a new one."""
    if executor is not None:
        return nullcontext(executor)
    return InProcess() if jobs == 1 else Workers(count=jobs)
