"""Where work runs, how it shows its progress, when it must stop.

One interface for all of it: `concurrent.futures.Executor`. In-process, one killable process per
task, or a cluster client's executor are the same to whoever submits.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from multiprocessing.connection import Connection
from typing import Any, TypeVar

import numpy as np

from workbench.errors import InputError, TimeLimitError, WorkbenchError
from workbench.solvers import Options

WALL_TIME = {"wall_time": 1}
"""Attribute of stored arrays that no re-run reproduces."""

T = TypeVar("T")
Progress = Callable[[str, int, int], None]
"""Called with what is being done, how much of it is done, and of how much."""


def silent(description: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


class InProcess(Executor):
    """Runs every task at once, in the caller's own process."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Processes(Executor):
    """Runs every task in a process of its own, and kills it at its time limit.

    A pool cannot kill one task without losing the others, and a solver that hangs in compiled code
    hears no polite request; so one process per task.

    Parameters
    ----------
    workers
        How many at once.
    time_limit
        Seconds after which a task is killed and its future raises `TimeLimitError`; None: never.
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
            if not ours.poll(self._time_limit):
                raise TimeLimitError(f"killed after its time limit of {self._time_limit:g} s")
            try:
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
        pipe.send((True, fn(*args, **kwargs)))
    except Exception as error:
        pipe.send((False, WorkbenchError(f"{type(error).__name__}: {error}")))


@dataclass
class Context:
    """What a method is given besides its Program: options, progress, clock and randomness."""

    options: Options = field(default_factory=Options)
    progress: Progress = silent
    statement_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        if not isinstance(self.options, Options):
            raise InputError(f"options must be Options(...), not {self.options!r}")

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
            limit = self.options.time_limit
            if limit is not None and time.perf_counter() - self.started > limit:
                raise TimeLimitError(
                    f"{description}: time limit of {limit:g} s reached at {done - 1} of {total}"
                )
            yield item
            self.progress(description, done, total)
