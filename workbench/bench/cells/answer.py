"""Answer one cell by its method: with limits, timed, certified and stored."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from workbench.bench.cells.clock import running
from workbench.bench.cells.machine import forget_peak_memory, peak_memory
from workbench.bench.cells.plan import loaded
from workbench.bench.cells.record import CELL, Record
from workbench.bench.cells.site import Site
from workbench.bench.notes import log
from workbench.bench.project import registry
from workbench.bench.question import Question
from workbench.bench.run import answer_arrays, information, now, publish, seal_folder
from workbench.bench.store import Store
from workbench.executor import Context, Workers
from workbench.executor.worker import printed
from workbench.program import Program
from workbench.solution import Solution, ask, judge
from workbench.solvers import Options, Outcome

WARM_UP = 10.0
"""Extra time [s] that a method's first call in a process gets for imports. A first call that takes
less than this, or compiles, is repeated, and only the second call is timed.
"""
CHECK_LIMIT = 600.0
"""Longest time [s] of the check of an answer, if there is a time limit; it does not count as the
method's time.
"""


@dataclass(frozen=True)
class Cell:
    """A cell, as it is sent to a worker.

    ``given`` are the parameters of its problem, as the user gave them; ``light``: it leaves no
    folder; ``verbose``: solvers print into its log.
    """

    question: Question
    code: str
    given: Mapping[str, Any]
    light: bool = False
    verbose: bool = False

    @property
    def options(self) -> Options:
        asked = self.question.options
        return Options(
            tolerance=asked["tolerance"],
            time_limit=asked["time_limit"],
            verbose=self.verbose,
            seed=asked["seed"],
        )


def answer(cell: Cell, place: Site) -> Record:
    """Answer a cell and certify the answer; unless the cell is light, its results folder stays.

    Raises
    ------
    WorkbenchError
        The problem cannot be loaded. A failure of the method is part of the record instead.
    """
    place.enter()
    started, clock = now(), time.perf_counter()
    bound = loaded(cell.question.problem, cell.given, cell.options.seed)
    method = cell.question.method
    assert isinstance(bound.task, Program) and method is not None
    said = _timed(bound.task, method, cell.options)
    allowed = None if cell.options.time_limit is None else CHECK_LIMIT
    with running(allowed, f"its check was killed after {CHECK_LIMIT:g} s"):
        solution = judge(bound.task, method, said.solution, said.context)
    record = Record.of(bound.task, solution, said.cpu, said.memory)
    if not cell.light:
        seconds = {**solution.seconds, "total": time.perf_counter() - clock}
        about = {"started": started, "seconds": seconds, "code": cell.code, CELL: record.to_json()}
        question = cell.question
        with Store(place.results).writing(question.problem, question.key) as writer:
            notes = [text] if (text := printed().strip()) else []
            data = answer_arrays(bound, solution)
            publish(writer, bound, question, solution, data, about, said.context.rows, notes)
    return record


_warm: set[tuple[type, str]] = set()
"""Programs and methods that this process has called before."""


def _timed(task: Program, method: str, options: Options) -> Said:
    """A method's answer, timed.

    Its first call in a process does not count if imports may have taken most of its time.
    """
    pair, limit = (type(task), method), options.time_limit
    if pair not in _warm:
        _warm.add(pair)
        first = _once(task, method, options, WARM_UP)
        took = sum(first.solution.seconds.values()) - first.compiling
        if first.compiling == 0.0 and took > WARM_UP and (limit is None or took <= limit):
            return first
    return _once(task, method, options)


@dataclass(frozen=True)
class Said:
    """A method's solution, CPU time and compilation time [s], and peak memory [byte]."""

    solution: Solution
    context: Context
    cpu: float
    compiling: float
    memory: float


def _once(task: Program, method: str, options: Options, longer: float = 0.0) -> Said:
    """A method's answer in one call, which may exceed its time limit by ``longer`` [s]."""
    context, limit = Context(options=options), options.time_limit
    forget_peak_memory()
    reason = "" if limit is None else f"killed at its time limit of {limit:.4g} s"
    if longer:
        reason += f" and {longer:g} s more, which a first call has for imports"
    with running(None if limit is None else limit + longer, reason) as clock:
        cpu = time.process_time()
        try:
            solution = ask(task, method, context)
        except SystemExit as error:
            words = f"the method called sys.exit({error.code!r})"
            solution = Solution(None, Outcome.CRASHED, words, None)
        cpu = time.process_time() - cpu
    return Said(solution, context, cpu, clock.compiling, peak_memory())


WARM = (
    *(__name__, "workbench.bench.formats.netcdf", "workbench.bench.formats.crate"),
    *("casadi", "clarabel", "control", "cvxpy", "numba.core.event", "scipy.optimize", "slycot"),
)
"""Modules that a worker imports before its first cell."""


def cell_workers(count: int, memory_limit: int | None, threads: int) -> Workers:
    """A pool of processes that have imported everything cells need."""
    return Workers(count=count, threads=threads, memory_limit=memory_limit, preload=WARM)


_apart = threading.local()
"""For each thread: the child process that answers cells for another executor."""


def answer_apart(cell: Cell, place: Site, memory_limit: int | None, threads: int) -> Record:
    """Answer a cell in a child process of this worker, which can be killed without harm to it."""
    pool: Workers | None = getattr(_apart, "pool", None)
    if pool is None or (pool.memory_limit, pool.threads) != (memory_limit, threads):
        if pool is not None:
            pool.shutdown()
        pool = _apart.pool = cell_workers(1, memory_limit, threads)
    return pool.submit(answer, cell, place).result()


def store_lost(cell: Cell, record: Record, place: Site) -> None:
    """Write a results folder for a cell whose worker died or was killed."""
    question = cell.question
    solution = Solution(None, Outcome(record.outcome), record.message, None)
    about = {"started": now(), "seconds": {"total": 0.0}, "code": cell.code, CELL: record.to_json()}
    info = information(question, solution, about)
    with Store(place.results).writing(question.problem, question.key) as writer:
        folder = writer.start()
        text = log(info, solution, (), ())
        seal_folder(writer, folder, info, text, registry().find(question.problem).entry.help)
