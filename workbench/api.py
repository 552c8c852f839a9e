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


def problems(pattern: str = "*") -> Catalogue:
    """The registered problems whose name fits a shell pattern, without importing them."""
    return Catalogue(tuple(registry().match(pattern)))


def load(name: str, **parameters: Any) -> Task:
    """A named problem with its data bound: a Program or a Study.

    Problems that it needs are run first if their results are missing.

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
    """Run a named problem, or return its stored answer. An iteration that was stopped is resumed.

    Parameters
    ----------
    name
        A registered name.
    method
        A method of its Program; None: the default one.
    tolerance, time_limit, verbose, seed
        As in `Options`.
    fresh
        Compute anew even if the answer is stored or a stopped iteration could be resumed.
    executor
        Executor for parts of the work that are independent of each other, such as the draws of an
        ensemble or the starts of a search: any `concurrent.futures.Executor`, such as that of
        `connect`; None: threads. The answer does not depend on it.
    progress, watch
        ``progress`` is called with how much of the work is done, ``watch`` after each round of an
        iteration with the rows of all its rounds. None: shown at a terminal or in a notebook.
    parameters
        Parameters of the problem.

    Returns
    -------
    Run
        Its ``holds`` tells whether the certificate holds. A failure is returned as a Run too; its
        ``outcome`` and ``certificate`` say why it failed. An iteration that reaches its time limit
        returns its best answer so far, with ``best_so_far`` set and the outcome "time limit"; such
        a Run is not reused later.
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
    """Run every method on every problem that fits a pattern, at every accuracy level.

    Each cell (problem, method, level, repetition) is stored when it ends. An interrupted comparison
    resumes, and only new cells are computed. By default cells run in separate processes that are
    started once; a cell that hangs, crashes or takes too much memory spoils no other.

    Parameters
    ----------
    pattern
        Shell pattern of the problems. Problems marked slow are included only with ``slow``, or if
        the pattern is their full name.
    methods
        Names of methods; None: all that each problem has, but those that say that they are never
        the best, which are compared if they are named.
    accuracies
        Levels among "low", "middle", "high".
    time_limit
        Longest time of each cell [s], its statement included; the cell is killed after it.
    memory_limit
        Most resident memory of a cell's process [byte]; the process is killed if it takes more.
    repeat
        How often each cell is timed, not counting a method's first call in a process.
    seed
        Seed of the methods, and of the order in which cells run.
    jobs, threads
        Number of processes, and number of threads that linear algebra and solvers use in each.
    executor
        Where cells run instead: `InProcess` for debugging, or any `concurrent.futures.Executor`,
        such as that of `connect`, which runs each cell in a child process with these limits.
    light
        Keep only a record of each cell, without a folder for its answer.
    fresh
        Compute anew even if cells are stored.
    verbose
        Let the solvers print into the logs of their cells.
    progress
        Called with the number of cells that are done. None: shown at a terminal or in a notebook.

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

    Each point is a run of its own and is stored when it ends. An interrupted sweep resumes, and
    only new points are computed. A point that fails spoils no other.

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
        Where points run instead: any `concurrent.futures.Executor`, such as that of `connect`.
    progress
        Called with the number of points that are done. None: shown at a terminal or in a notebook.
    parameters
        Further parameters of the problem.

    Returns
    -------
    Run
        A results folder. ``data`` has the swept parameters as dimensions, and as variables every
        metric of the runs, their ``outcome``, ``message``, ``key``, ``holds`` and ``seconds``. It
        holds if every point holds.

    Raises
    ------
    UnknownNameError, InputError
        No such problem or parameter; a value that does not fit; or a value that is given twice.
    """
    from workbench.bench.run_sweep import grid_of, run_sweep

    options = Options(tolerance=tolerance, time_limit=time_limit, seed=seed)
    grid = grid_of(name, over, method, options, parameters, fresh=fresh)
    with shown_live(f"sweep {name}") as (bar, _):
        return run_sweep(grid, executor=executor, jobs=jobs, progress=progress or bar)


def connect(address: str, *, workers: int | None = None, threads: int = 1) -> Cluster:
    """An executor for `run`, `compare` and `sweep` that uses the workers of a Dask scheduler.

    The workers use the caller's problem folders, results folder and list of solvers, as they are
    now. The folders must have the same names there, as on a shared file system. Versions and
    sources of everything that can change an answer must be the same too; then answers are the same
    wherever they are computed.

    Parameters
    ----------
    address
        Address such as "tcp://10.0.0.5:8786"; or "local": processes on this machine, which end with
        the executor.
    workers
        Number of local worker processes; None: one for each core.
    threads
        Threads that linear algebra and solvers may use in each task.

    Returns
    -------
    Cluster
        A `concurrent.futures.Executor`; close it by ``with`` or ``shutdown()``.

    Raises
    ------
    ClusterError
        Dask is not installed, no scheduler answers, or a worker lacks a folder or has other code.
    InputError
        A count is below 1, or ``workers`` is given for a scheduler that has its own.
    """
    from workbench.bench.cells.site import SameCode

    results_root().mkdir(parents=True, exist_ok=True)  # or no worker finds the folder
    return Cluster(address, SameCode.here(), workers=workers, threads=threads)


def results(pattern: str = "*") -> list[Run]:
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
        Also run the problem again and compare the arrays.
    trust
        Import the problems of the project that contains the folder, if that is not the current
        project. This runs somebody's code.
    deep
        The second opinion also tries more draws, samples and frequencies, and makes its expensive
        checks. The cells of a comparison are certified again, and those without a stored answer are
        run again.

    Returns
    -------
    Verification
        Its ``holds`` tells whether the stored answer passes the certificate that is recomputed
        here. The log, the seconds and the method's claim are covered by their checksums only.
    """
    from workbench.bench.trust.untrusted import possible_path
    from workbench.bench.verify import verify_folder

    return verify_folder(possible_path(path), rerun=rerun, trust=trust, deep=deep)
