"""Every problem by every method at every accuracy level: planned, answered, stored, and viewed.

Stored cells are read. The others go to the executor, in a random order drawn with the seed, and
each is stored when it ends. The comparison's own folder is made from the cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset
from workbench.bench.cells.answer import Cell, answer, answer_apart, cell_workers, store_lost
from workbench.bench.cells.plan import Plan, plan
from workbench.bench.cells.record import Record
from workbench.bench.cells.site import Site
from workbench.bench.cells.stored import Journal, in_folder
from workbench.bench.cells.table import Filled, Labels, cell_table
from workbench.bench.code import code_hash
from workbench.bench.comparison import NOT_COMPARED, UNFIT, Comparison
from workbench.bench.describe import describe
from workbench.bench.project import registry, results_root
from workbench.bench.question import Question, asked, canonical
from workbench.bench.results import COMPARISON, Run
from workbench.bench.run import Bound, default_bench
from workbench.bench.store import Store
from workbench.errors import InputError, RegistryError, UnknownNameError
from workbench.executor import InProcess, Progress, Workers, finished_calls, no_progress
from workbench.program import is_registered
from workbench.solvers import ACCURACY, Options, Outcome


@dataclass(frozen=True)
class Asked:
    """The question of a comparison.

    ``methods`` None: every method of every problem, but those that are compared only by name.
    ``executor`` None: a pool of processes.
    ``light``: cells leave records instead of folders; not ``kept``: not even records.
    """

    problems: tuple[str, ...]
    methods: tuple[str, ...] | None
    accuracies: tuple[str, ...]
    parameters: Mapping[str, Any]
    time_limit: float | None = None
    memory_limit: int | None = None
    repeat: int = 1
    seed: int = 0
    light: bool = False
    fresh: bool = False
    kept: bool = True
    verbose: bool = False
    jobs: int = 1
    threads: int = 1
    executor: Executor | None = None

    def __call__(self, progress: Progress = no_progress) -> Dataset:
        """The dataset of a comparison; cells that are not stored are computed."""
        with self._working() as executor, self._journal() as journal:
            cells = self._known(executor, journal, progress)
            self._answer(cells, executor, journal, progress)
        entries = {
            labels: Filled(one.record, one.key, one.code, one.served, one.optimal)
            for labels, one in cells.places.items()
            if one.record is not None
        }
        settings = {
            "seed": self.seed,
            "time_limit": np.nan if self.time_limit is None else self.time_limit,
            "memory_limit": np.nan if self.memory_limit is None else self.memory_limit,
            "threads": self.threads,
            "parameters": canonical(self.parameters),
            "light": int(self.light),
        }
        return cell_table(entries, cells.programs, cells.sizes, settings)

    def planned(self, progress: Progress = no_progress) -> Cells:
        """The cells before any is computed; those that are stored or unfit have a record."""
        with self._working() as executor, self._journal() as journal:
            return self._known(executor, journal, progress, stored=True)

    def _working(self) -> AbstractContextManager[Executor]:
        """The executor for the cells: the one given, which stays open, or a new pool."""
        if self.executor is not None:
            return nullcontext(self.executor)
        return cell_workers(self.jobs, self.memory_limit, self.threads)

    def _journal(self) -> AbstractContextManager[Journal | None]:
        return Journal(results_root()) if self.light and self.kept else nullcontext()

    def _known(
        self,
        executor: Executor,
        journal: Journal | None,
        progress: Progress,
        *,
        stored: bool = False,
    ) -> Cells:
        """The cells, with records for those that are stored; ``stored`` as in `cells`."""
        cells = self.cells(executor, progress, stored=stored)
        if not self.fresh:
            cells.look_up(journal)
        return cells

    def cells(
        self, executor: Executor, progress: Progress = no_progress, *, stored: bool = False
    ) -> Cells:
        """The cells by their labels; ``stored``: no need of a problem may be run to find them."""
        place = Site.here()
        calls = (
            (name, (plan, name, dict(self.parameters), self.seed, place, stored))
            for name in self.problems
        )
        found: dict[str, Plan] = {}
        progress("problems", 0, len(self.problems))
        for name, future in finished_calls(executor, calls):
            error = future.exception()
            found[name] = (
                Plan(name, failure=Record.lost(error).message) if error else future.result()
            )
            progress("problems", len(found), len(self.problems))
        cells = Cells(Store(results_root()))
        for name in self.problems:
            self._place(cells, found[name])
        if not cells.places:
            named = ", ".join(self.problems)
            raise InputError(f"nothing to compare: {named} has no methods, as a study has none")
        return cells

    def _place(self, cells: Cells, planned: Plan) -> None:
        """Add every cell of a problem to the table."""
        cells.programs[planned.problem] = planned.program
        cells.sizes[planned.problem] = planned.size
        for method in self.methods if self.methods is not None else _methods(planned):
            known = planned.methods.get(method)
            reason = _why_not(planned, method)
            if self.methods is None and reason is None and known is not None and known.by_name:
                reason = Record(NOT_COMPARED, message="ask by name")
            for level, repetition in product(self.accuracies, range(self.repeat)):
                labels = (planned.problem, method, level, repetition)
                if reason is not None or known is None or planned.question is None:
                    cells.put(labels, None, np.nan, False, reason)
                    continue
                options = Options(time_limit=self.time_limit, seed=self.seed)
                judged = known.tolerances[level]
                question = replace(planned.question, method=method, options=asked(options, judged))
                question = question.as_cell(repetition, self.memory_limit)
                cell = Cell(question, known.code, self.parameters, self.light, self.verbose)
                cells.put(labels, cell, judged, known.optimal, None)

    def _answer(
        self, cells: Cells, executor: Executor, journal: Journal | None, progress: Progress
    ) -> None:
        """Compute every cell that has no record; each is stored when it ends."""
        missing = cells.missing
        order = np.random.default_rng(self.seed).permutation(len(missing))
        place, apart = Site.here(), (self.memory_limit, self.threads)
        direct = isinstance(executor, Workers | InProcess)
        calls = (
            (
                missing[i],
                (answer, missing[i], place)
                if direct
                else (answer_apart, missing[i], place, *apart),
            )
            for i in order
        )
        total = len(cells.same)
        progress("cells", total - len(missing), total)
        for done, (cell, future) in enumerate(finished_calls(executor, calls), start=1):
            record = _ended(cell, future, place)
            if journal is not None:
                journal.keep(cell, record)
            cells.end(cell.question.key, record)
            progress("cells", total - len(missing) + done, total)


def _why_not(planned: Plan, method: str) -> Record | None:
    """The reason why a method cannot be asked; None if it can."""
    if planned.study:
        return Record(UNFIT, message=f"{planned.problem} is a study: it has no methods")
    if planned.failure:
        return Record(Outcome.FAILED, message=planned.failure)
    known = planned.methods.get(method)
    if known is None and is_registered(planned.program, method):
        raise InputError(
            f"method {method!r} of {planned.program} is registered in this process alone, and the "
            "cells run in others: put it in a Python file of a problems folder or behind an entry "
            "point of workbench.solvers, or compare with executor=InProcess() of workbench.executor"
        )
    reason = f"{planned.program} has no method {method!r}" if known is None else known.unfit
    return Record(UNFIT, message=reason) if reason else None


def _methods(planned: Plan) -> Sequence[str]:
    """The methods of a problem; if it cannot be loaded, those of its return annotation."""
    if planned.study:
        return ()
    told = describe(registry().find(planned.problem)).methods
    return list(planned.methods) or list(told) or ("default",)


def _ended(cell: Cell, future: Future[Record], place: Site) -> Record:
    """How a cell ended, even if its worker died."""
    error = future.exception()
    if error is None:
        return future.result()
    record = Record.lost(error)
    if not cell.light:
        store_lost(cell, record, place)
    return record


@dataclass
class Placed:
    """A cell at one of its places in the table."""

    cell: Cell | None
    key: str
    served: float
    optimal: bool
    record: Record | None

    @property
    def code(self) -> str:
        return self.cell.code if self.cell else ""


@dataclass
class Cells:
    """The cells of a comparison by their labels. Several accuracy levels may share a cell."""

    store: Store
    places: dict[Labels, Placed] = field(default_factory=dict)
    same: dict[str, list[Placed]] = field(default_factory=dict)
    """Places in the table by the key of their cell."""
    programs: dict[str, str] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)

    def put(
        self,
        labels: Labels,
        cell: Cell | None,
        served: float,
        optimal: bool,
        record: Record | None,
    ) -> None:
        """Add a cell to the table; an unfit one gets its record at once."""
        placed = Placed(cell, cell.question.key if cell else "", served, optimal, record)
        self.places[labels] = placed
        if cell is not None:
            self.same.setdefault(placed.key, []).append(placed)

    @property
    def missing(self) -> list[Cell]:
        """The cells without a record, each of them once."""
        firsts = (places[0] for places in self.same.values())
        return [one.cell for one in firsts if one.cell is not None and one.record is None]

    def look_up(self, journal: Journal | None) -> None:
        """Read the stored cells, from light records or results folders."""
        for cell in self.missing:
            record = in_folder(self.store, cell) if journal is None else journal.find(cell)
            if record is not None:
                self.end(cell.question.key, record)

    def end(self, key: str, record: Record) -> None:
        """Enter a record at every place of its cell."""
        for one in self.same[key]:
            one.record = record


def asked_for(
    pattern: str,
    methods: Sequence[str] | None,
    accuracies: Sequence[str],
    parameters: Mapping[str, Any],
    *,
    slow: bool = False,
    **settings: Any,
) -> Asked:
    """A comparison with checked names and numbers.

    Raises
    ------
    UnknownNameError, InputError
        No such problem, method, level or parameter; a limit or count that is not positive.
    """
    unknown = [name for name in accuracies if name not in ACCURACY]
    if unknown or not accuracies:
        raise InputError(f"accuracy levels are {', '.join(ACCURACY)}, not {unknown or 'none'}")
    if isinstance(methods, str):
        methods = [name for name in methods.split(",") if name]
    if methods is not None and not methods:
        raise InputError("a comparison needs at least one method")
    for name in ("repeat", "jobs", "threads"):
        if settings.get(name, 1) < 1:
            raise InputError(f"{name} must be 1 or more, not {settings[name]}")
    Options(time_limit=settings.get("time_limit"), seed=settings.get("seed", 0))
    entries = registry().match(pattern)
    names = tuple(one.name for one in entries if slow or not one.slow or one.name == pattern)
    if not names:
        raise InputError(f"every problem that fits {pattern!r} is slow; ask for slow ones too")
    known = [describe(registry().find(name)).methods for name in names]
    # the methods of a problem without a return annotation are known only once it is loaded
    if all(known):
        for name in methods or ():
            if not any(name in one for one in known):
                error = UnknownNameError("method", name, set().union(*known))
                wrong = registry().unfit
                raise RegistryError("; ".join([str(error), *wrong])) if wrong else error
    for name in names:  # a wrong parameter is an error, not a table full of failures
        registry().find(name).bind(parameters)
    chosen = None if methods is None else tuple(dict.fromkeys(methods))
    return Asked(names, chosen, tuple(accuracies), dict(parameters), **settings)


def run_comparison(pattern: str, comparison: Asked, progress: Progress = no_progress) -> Run:
    """Compute the cells and write the comparison's folder. See `workbench.compare`."""
    data = comparison(progress)
    options = Options(seed=comparison.seed)
    names = ("problems", "methods", "accuracies", "parameters", "repeat", "memory_limit")
    stored = {"pattern": pattern, **{name: getattr(comparison, name) for name in names}}
    time = {"time_limit": comparison.time_limit}
    question = Question(COMPARISON, stored, {}, {}, None, {**asked(options), **time})
    task = Comparison(lambda context: data)
    bound = Bound(None, stored, {}, task)
    bench = default_bench(options)
    with bench.store.writing(question.problem, question.key) as writer:
        return bench.answer(bound, question, code_hash([type(task).__module__]), writer)


def described(cells: Cells) -> Iterator[tuple[Labels, str]]:
    """The state of each cell: stored, would run, or the reason why it cannot."""
    for labels, one in cells.places.items():
        if one.cell is None:
            assert one.record is not None
            yield labels, f"{one.record.outcome}: {one.record.message}"
        else:
            yield labels, "stored" if one.record is not None else "would run"
