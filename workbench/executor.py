"""Where work runs, how it shows its progress, when it must stop, where it keeps its state.

One interface for all of it: `concurrent.futures.Executor`. In-process, one killable process per
task, or a cluster client's executor are the same to whoever submits.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from multiprocessing.connection import Connection
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from workbench.errors import InputError, TimeLimitError, WorkbenchError
from workbench.solvers import Options

WALL_TIME: dict[str, Any] = {"wall_time": 1}
"""Attribute of stored arrays that no re-run reproduces."""

S = TypeVar("S")
T = TypeVar("T")
Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and of how much."""


Row = Mapping[str, float | int | str]
"""One round of an iteration, by column."""
Watch = Callable[[Sequence[Row]], None]
"""Called after every round of an iteration with the rows of all its rounds."""


def silent(description: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


def unwatched(rows: Sequence[Row]) -> None:
    """Rounds that nobody watches."""


def shown(value: float | int | str) -> str:
    """An entry of a row as people read it."""
    if not isinstance(value, float):
        return str(value)
    return "-" if math.isnan(value) else f"{value:.4g}"


class Checkpoint:
    """Store of an iteration's state after each round; this base class keeps nothing."""

    def save(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Keep a state, arrays of numbers by name, in place of the one before."""

    def load(self) -> dict[str, NDArray[Any]] | None:
        """The state in which an earlier run of the same question was stopped, None without one."""
        return None


class InProcess(Executor):
    """Runs every task at once, in the caller's own process."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Threads(ThreadPoolExecutor):
    """Runs tasks in threads of the caller's process, for compiled code that lets others run.

    BLAS keeps to one thread meanwhile: its own threads spin while they wait, on the workers' cores.
    """

    def __init__(self, workers: int | None = None) -> None:
        super().__init__(os.cpu_count() if workers is None else workers)
        self._limits = threadpool_limits(1, "blas")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._limits.restore_original_limits()


class Processes(Executor):
    """Runs every task in a process of its own, and kills it at its time limit.

    A pool cannot kill one task without losing the others, and a solver that hangs in compiled code
    hears no polite request; so one process per task.

    Parameters
    ----------
    workers
        How many at once.
    time_limit
        Seconds from its start in the process after which a task is killed and its future raises
        `TimeLimitError`; None: never.
    """

    def __init__(self, workers: int, time_limit: float | None = None) -> None:
        self._threads = ThreadPoolExecutor(workers)
        self._time_limit = time_limit

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        return self._threads.submit(self._run, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._threads.shutdown(wait, cancel_futures=cancel_futures)

    def _run(self, fn: Callable[..., T], args: tuple[Any, ...], kwargs: dict[str, Any]) -> T:
        # A fork would copy locks that solver threads may hold.
        spawn = multiprocessing.get_context("spawn")
        ours, theirs = spawn.Pipe(duplex=False)
        process = spawn.Process(target=_send_result, args=(theirs, fn, args, kwargs), daemon=True)
        process.start()
        theirs.close()
        try:
            try:
                ours.recv()  # the process has started; imports are not the task's time
                if not ours.poll(self._time_limit):
                    raise TimeLimitError(f"killed after its time limit of {self._time_limit:g} s")
                done, value = ours.recv()
            except EOFError:
                process.join()
                raise WorkbenchError(
                    f"the worker process died with exit code {process.exitcode}"
                ) from None
        finally:
            process.kill()
            process.join()
            ours.close()
        if done:
            return value
        raise value


def _send_result(
    pipe: Connection, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> None:
    try:
        pipe.send("started")
        pipe.send((True, fn(*args, **kwargs)))
    except KeyboardInterrupt:
        pipe.send((False, WorkbenchError("interrupted")))
    except Exception as error:
        pipe.send((False, WorkbenchError(f"{type(error).__name__}: {error}")))


def spread(
    function: Callable[[T], S],
    items: Sequence[T],
    executor: Executor,
    progress: Progress = silent,
    description: str = "",
    batch: int = 1,
) -> list[S]:
    """Results of a function of many items, in their order; `batch` of them make one task.

    A task of `Processes` starts a process, so it should be worth seconds. The first error that is
    met is raised, and what has not begun by then is not begun. Raises InputError for a batch below
    1.
    """
    if batch < 1:
        raise InputError(f"batch is {batch}; it must be 1 or more")
    sizes: dict[Future[list[S]], int] = {}
    told: set[Future[list[S]]] = set()

    def tell(future: Future[list[S]]) -> None:
        future.result()
        told.add(future)
        progress(description, sum(sizes[one] for one in told), len(items))

    progress(description, 0, len(items))
    try:
        for start in range(0, len(items), batch):
            part = items[start : start + batch]
            future = executor.submit(_each, function, part)
            sizes[future] = len(part)
            if future.done():  # in process it is over before the next one begins
                tell(future)
        for future in as_completed(sizes):
            if future not in told:
                tell(future)
    finally:
        for future in sizes:
            future.cancel()
    return [result for future in sizes for result in future.result()]


def _each(function: Callable[[T], S], items: Sequence[T]) -> list[S]:
    return [function(item) for item in items]


@dataclass
class Context:
    """The second argument of every method: options, progress, clock and randomness.

    An iteration goes over `rounds`, tells each by `record`, and leaves its state in ``checkpoint``.
    ``rows`` are the rounds told so far; ``stopped`` says how the time limit ended an iteration.
    """

    options: Options = field(default_factory=Options)
    progress: Progress = silent
    watch: Watch = unwatched
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    statement_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    rows: list[Row] = field(default_factory=list)
    stopped: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.options, Options):
            raise InputError(f"options must be Options(...), not {self.options!r}")

    @contextmanager
    def at(self, tolerance: float) -> Iterator[None]:
        """Ask for another tolerance inside."""
        asked = self.options
        self.options = replace(asked, tolerance=tolerance)
        try:
            yield
        finally:
            self.options = asked

    @cached_property
    def rng(self) -> np.random.Generator:
        """The run's one random generator."""
        return np.random.default_rng(self.options.seed)

    @contextmanager
    def stating(self) -> Iterator[None]:
        """Book the time spent inside as statement: building and compiling the program."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.statement_seconds += time.perf_counter() - start

    def track(self, items: Iterable[T], description: str) -> Iterator[T]:
        """Iterate with progress shown; raise `TimeLimitError` once the time limit has passed."""
        total = len(items) if isinstance(items, Sized) else 0
        self.progress(description, 0, total)
        for done, item in enumerate(items, start=1):
            if self._late:
                raise TimeLimitError(
                    f"{description}: {self._limit} reached at {done - 1} of {total}"
                )
            yield item
            self.progress(description, done, total)

    def spread(self, function: Callable[[T], S], items: Sequence[T], description: str) -> list[S]:
        """Results of a function of many items, in threads, for compiled code that lets others run.

        Progress is shown, and `TimeLimitError` raised once the time limit has passed.
        """

        def in_time(item: T) -> S:
            self.seconds_left(description)
            return function(item)

        with Threads() as pool:
            return spread(in_time, items, pool, self.progress, description)

    def rounds(self, count: int, description: str, first: int = 0) -> Iterator[int]:
        """Numbers of an iteration's rounds, those before ``first`` done by an earlier run.

        Whatever is recorded must be an answer, if not the best. So the time limit ends the
        iteration, and `solve` marks its answer as the best so far; before there is any it raises
        `TimeLimitError`.
        """
        self.progress(description, first, count)
        for number in range(first, count):
            if self._late:
                told = len(self.rows)
                if not told:
                    raise TimeLimitError(f"{description}: {self._limit} reached before any answer")
                after = f"{told} rounds" if told > 1 else "1 round"
                self.stopped = f"{self._limit} reached after {after}; best so far"
                return
            yield number
            self.progress(description, number + 1, count)

    def record(self, row: Row) -> None:
        """Tell whoever watches of a round; an iteration that goes on tells the earlier ones too."""
        self.rows.append(row)
        self.watch(self.rows)

    def seconds_left(self, description: str) -> float:
        """Seconds until the time limit, infinite without one; raise `TimeLimitError` after it."""
        if self._late:
            raise TimeLimitError(f"{description}: {self._limit} reached")
        limit = self.options.time_limit
        return math.inf if limit is None else limit - (time.perf_counter() - self.started)

    @property
    def _late(self) -> bool:
        limit = self.options.time_limit
        return limit is not None and time.perf_counter() - self.started > limit

    @property
    def _limit(self) -> str:
        return f"time limit of {self.options.time_limit:g} s"
