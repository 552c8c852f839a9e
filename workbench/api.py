"""The Python face: problems, load, run, compare, results, verify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workbench.bench.project import registry, results_root
from workbench.executor import Cluster, Progress, Watch
from workbench.executor.live import shown_live
from workbench.solvers import Options

if TYPE_CHECKING:
    from workbench.bench.discovery import Entry
    from workbench.bench.results import Run
    from workbench.bench.verify import Verification
    from workbench.program import Task


@dataclass(frozen=True)
class Catalogue(Sequence["Entry"]):
    """Registered problems; prints as a table."""

    entries: tuple[Entry, ...]

    def __getitem__(self, index: Any) -> Any:
        return self.entries[index]

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        width = max((len(entry.name) for entry in self.entries), default=0)
        return "\n".join(f"{entry.name:<{width}}  {entry.summary}" for entry in self.entries)


def problems(*, pattern: str = "*") -> Catalogue:
    """The registered problems whose name fits a shell pattern, without importing them."""
    return Catalogue(tuple(registry().match(pattern)))


def load(name: str, **parameters: Any) -> Task:
    """A named problem with its data bound: a Program or a Study.

    Its needs are run first where their results are missing.

    Raises
    ------
    UnknownNameError, InputError
        No such problem or parameter; a value that does not fit.
    """
    from workbench.bench.run import default_bench

    return default_bench().load(name, parameters).task


def run(
    name: str,
    *,
    method: str | None = None,
    tolerance: float | str = "middle",
    time_limit: float | None = None,
    verbose: bool = False,
    seed: int = 0,
    fresh: bool = False,
    executor: Executor | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
    **parameters: Any,
) -> Run:
    """Run a named problem, or find its stored answer; an iteration goes on where it was stopped.

    Parameters
    ----------
    name
        A registered name.
    method
        A method of its Program; None: the default one.
    tolerance, time_limit, verbose, seed
        As in `Options`.
    fresh
        Compute anew even where the answer is stored, or an iteration was stopped.
    executor
        Where parts that do not wait for each other go, such as the draws of an ensemble or the
        starts of a search: anybody's `concurrent.futures.Executor`, as that of `connect`; None:
        threads. The answer is the same.
    progress, watch
        Told how far the work is; told the rows of an iteration's rounds after each. None: a
        terminal or a notebook shows it.
    parameters
        Parameters of the problem.

    Returns
    -------
    Run
        Its ``holds`` tells whether the certificate does; a failure is a Run too, whose
        ``outcome`` and ``certificate`` say why. So is the best so far of an iteration that met
        its time limit: ``best_so_far``, of outcome "time limit", and not found again.
    """
    from workbench.bench.run import default_bench

    options = Options(tolerance=tolerance, time_limit=time_limit, verbose=verbose, seed=seed)
    with shown_live(name) as (bar, table):
        bench = default_bench(
            options, progress or bar, watch or table, fresh=fresh, executor=executor
        )
        return bench.run(name, method, parameters)


def compare(
    pattern: str,
    *,
    methods: Sequence[str] | None = None,
    accuracies: Sequence[str] = ("low", "middle", "high"),
    time_limit: float | None = None,
    memory_limit: int | None = None,
    repeat: int = 1,
    seed: int = 0,
    jobs: int = 1,
    threads: int = 1,
    executor: Executor | None = None,
    light: bool = False,
    fresh: bool = False,
    slow: bool = False,
    verbose: bool = False,
    progress: Progress | None = None,
    **parameters: Any,
) -> Run:
    """Every problem that fits a pattern, by every method, at every accuracy level.

    A cell (problem, method, level, repetition) is stored when it ends and found again: what is
    stopped goes on where it was, and what is added is all that is computed. By default cells run in
    warm processes of their own; one that hangs, crashes or takes too much memory costs itself.

    Parameters
    ----------
    pattern
        Shell pattern of the problems; those marked slow only with ``slow``, or by their full name.
    methods
        Names of methods; None: all that each problem has.
    accuracies
        Levels among "low", "middle", "high".
    time_limit
        Seconds for each cell, from the start of its statement; it is killed there.
    memory_limit
        Resident memory of a cell's process [byte]; it is killed beyond.
    repeat
        How often each cell is timed. What is a method's first call in a process is not counted.
    seed
        Of the methods, and of the order in which cells run.
    jobs, threads
        Processes, and the threads of linear algebra and solvers in each.
    executor
        Where cells run instead: `InProcess` to look for errors, or anybody's
        `concurrent.futures.Executor`, such as that of `connect`; there each has a child process
        under its limits.
    light
        Keep a record of each cell only, without a folder for its answer.
    fresh
        Compute anew even where cells are stored.
    verbose
        Let the solvers print into the logs of their cells.
    progress
        Told how many cells are done. None: a terminal or a notebook shows it.

    Returns
    -------
    Run
        Its ``data`` has dims (problem, by_method, accuracy, repetition): verdict, outcome, claim,
        objective, certified gap, wall and CPU seconds, memory, key.

    Raises
    ------
    UnknownNameError, InputError
        No such problem, method, level or parameter; a limit or count that is not positive.
    """
    from workbench.bench.compare import asked_for, run_comparison

    asked = asked_for(
        pattern,
        methods,
        accuracies,
        parameters,
        slow=slow,
        time_limit=time_limit,
        memory_limit=memory_limit,
        repeat=repeat,
        seed=seed,
        jobs=jobs,
        threads=threads,
        executor=executor,
        light=light,
        fresh=fresh,
        verbose=verbose,
    )
    with shown_live(f"compare {pattern}") as (bar, _):
        return run_comparison(pattern, asked, progress or bar)


def sweep(
    name: str,
    over: Mapping[str, Sequence[Any]],
    *,
    method: str | None = None,
    tolerance: float | str = "middle",
    time_limit: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    executor: Executor | None = None,
    fresh: bool = False,
    progress: Progress | None = None,
    **parameters: Any,
) -> Run:
    """Run a problem over a grid of its parameters.

    Each point is a run of its own, stored when it ends and found again: a sweep that is stopped
    goes on where it was. A point that fails costs itself.

    Parameters
    ----------
    name
        A registered name.
    over
        Values by parameter, such as ``{"speed": [1, 2, 5]}``; the grid is their product.
    method
        A method of its Program; None: the default one.
    tolerance, time_limit, seed, fresh
        As `run` takes them, for each point.
    jobs
        Processes.
    executor
        Where points run instead: anybody's `concurrent.futures.Executor`, such as that of
        `connect`.
    progress
        Told how many points are done. None: a terminal or a notebook shows it.
    parameters
        Further parameters of the problem.

    Returns
    -------
    Run
        A results folder. ``data`` has the swept parameters as dimensions, and as variables every
        metric of the runs, their ``outcome``, ``message``, ``key``, ``holds`` and ``seconds``. It
        holds where every point does.

    Raises
    ------
    UnknownNameError, InputError
        No such problem or parameter; a value that does not fit, or is there twice.
    """
    from workbench.bench.sweeps import grid_of, run_sweep

    options = Options(tolerance=tolerance, time_limit=time_limit, seed=seed)
    grid = grid_of(name, over, method, options, parameters, fresh=fresh)
    with shown_live(f"sweep {name}") as (bar, _):
        return run_sweep(grid, executor=executor, jobs=jobs, progress=progress or bar)


def connect(address: str, *, workers: int | None = None, threads: int = 1) -> Cluster:
    """An executor on the workers of a Dask scheduler, for `run`, `compare` and `sweep`.

    Problem folders, the results folder and solvers are those of the caller at this time. Workers
    need the same names for them, as on a shared file system, and the same versions and sources of
    everything that can change an answer; then answers are the same wherever they are computed.

    Parameters
    ----------
    address
        Such as "tcp://10.0.0.5:8786"; or "local": processes of this machine, which end with the
        executor.
    workers
        How many processes of this machine; None: one for each core.
    threads
        Threads that linear algebra and solvers may use in each task.

    Returns
    -------
    Cluster
        A `concurrent.futures.Executor`; leave it by ``with`` or ``shutdown()``.

    Raises
    ------
    ClusterError
        Dask is not installed, no scheduler answers, or a worker lacks a folder or has other code.
    InputError
        A count below 1, or ``workers`` for a scheduler that has its own.
    """
    from workbench.bench.cells.site import SameCode

    results_root().mkdir(parents=True, exist_ok=True)  # or no worker finds it
    return Cluster(address, SameCode.here(), workers=workers, threads=threads)


def results(*, pattern: str = "*") -> list[Run]:
    """The finished runs of the project whose problem fits a shell pattern."""
    from workbench.bench.results import stored_runs

    return stored_runs(results_root(), pattern)


def verify(
    path: str | Path, *, rerun: bool = False, trust: bool = False, deep: bool = False
) -> Verification:
    """Verify a results folder: checksums, key, and the certificate from the stored arrays alone.

    Parameters
    ----------
    path
        The folder.
    rerun
        The question is also answered anew and the arrays compared.
    trust
        Import the problems of the project that the folder lies in, where that is not the project
        at hand: they are somebody's code.
    deep
        The second opinion also tries more draws, samples and frequencies, and its dear checks; the
        cells of a comparison are certified again, and those without a stored answer answered anew.

    Returns
    -------
    Verification
        Its ``holds`` tells whether the certificate, recomputed here, holds for what is stored. The
        log, the seconds and the method's claim are covered by their checksums only.
    """
    from workbench.bench.trust.untrusted import possible_path
    from workbench.bench.verify import verify_folder

    return verify_folder(possible_path(path), rerun=rerun, trust=trust, deep=deep)
