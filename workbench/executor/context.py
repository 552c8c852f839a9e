"""The context of a method: options, progress, clock, random numbers, and storage of its state."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError, TimeLimitError
from workbench.executor.local import InProcess, Threads
from workbench.executor.progress import Progress, Row, Watch, no_progress, no_watch
from workbench.executor.spread import spread
from workbench.solvers import Options

S = TypeVar("S")
T = TypeVar("T")


TASKS = 64
"""Number of tasks into which the items are grouped for an executor, which may be far away."""


class Checkpoint:
    """Storage for an iteration's state after each round; this base class stores nothing.

    Examples
    --------
    >>> from workbench.executor import Checkpoint
    >>> Checkpoint().load() is None
    True
    """

    def save(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Store a state, numeric arrays by name, in place of the previous one."""

    def load(self) -> dict[str, NDArray[Any]] | None:
        """The state in which an earlier run of the same question was stopped.

        None if there is none.
        """
        return None


@dataclass
class Context:
    """The second argument of every method: options, progress, clock and randomness.

    An iteration loops over `rounds`, reports each by `record`, and stores its state in
    ``checkpoint``. ``executor`` runs parts of the work; None: threads of this process. ``rows`` are
    the rounds reported so far; ``stopped`` says how the time limit ended an iteration.
    ``reserved`` [s] is the part of the time limit that is reserved for the steps after the search.

    Examples
    --------
    >>> from workbench import Options
    >>> from workbench.executor import Context
    >>> context = Context(options=Options(tolerance="low", seed=1))
    >>> for number in context.rounds(3, "search"):
    ...     context.record({"round": number, "peak": 2.0 / (number + 1)})
    ...
    >>> len(context.rows), context.options.accuracy
    (3, 0.001)
    """

    _: KW_ONLY
    options: Options = field(default_factory=Options)
    progress: Progress = no_progress
    watch: Watch = no_watch
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    executor: Executor | None = None
    statement_seconds: float = 0.0
    started: float = field(default_factory=time.perf_counter)
    rows: list[Row] = field(default_factory=list)
    stopped: str = ""
    reserved: float = field(default=0.0, init=False)
    _told: tuple[str, int, int] | None = field(default=None, init=False, repr=False)
    _tried: str = field(default="", init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.options, Options):
            raise InputError(f"options must be Options(...), not {self.options!r}")

    @contextmanager
    def at(self, tolerance: float) -> Iterator[None]:
        """Inside, the tolerance is another one."""
        asked = self.options
        self.options = replace(asked, tolerance=tolerance)
        try:
            yield
        finally:
            self.options = asked

    @cached_property
    def rng(self) -> np.random.Generator:
        """The random number generator of the run."""
        return np.random.default_rng(self.options.seed)

    @contextmanager
    def stating(self) -> Iterator[None]:
        """Time spent inside counts as stating the problem: building and compiling the program."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.statement_seconds += time.perf_counter() - start

    def track(self, items: Iterable[T], description: str) -> Iterator[T]:
        """Iterate with progress shown; raises `TimeLimitError` once the time limit has passed."""
        total = len(items) if isinstance(items, Sized) else 0
        self.progress(description, 0, total)
        for done, item in enumerate(items, start=1):
            if self.late:
                raise TimeLimitError(
                    f"{description}: {self._limit} reached at {done - 1} of {total}"
                )
            yield item
            self.progress(description, done, total)

    def spread(self, function: Callable[[T], S], items: Sequence[T], description: str) -> list[S]:
        """Results of a function of many items, computed by the executor or in threads.

        Threads help if the compiled code lets others run. Progress is shown, and `TimeLimitError`
        is raised once the time limit has passed.
        """

        def in_time(item: T) -> S:
            self.seconds_left(description)
            return function(item)

        def heard(text: str, done: int, total: int) -> None:
            self.seconds_left(text)
            self.progress(text, done, total)

        if self.executor is not None:
            batch = max(1, len(items) // TASKS)
            return spread(
                function, items, self.executor, progress=heard, description=description, batch=batch
            )
        with Threads() if len(items) > 1 else InProcess() as pool:
            return spread(in_time, items, pool, progress=self.progress, description=description)

    def rounds(self, count: int, description: str, *, first: int = 0) -> Iterator[int]:
        """Numbers of an iteration's rounds; those before ``first`` were done by an earlier run.

        Each recorded round must have an answer, though perhaps not the best. So the time limit ends
        the iteration, and `solve` marks its answer as the best so far. If no round is recorded yet,
        `TimeLimitError` is raised.
        """
        self.progress(description, first, count)
        for number in range(first, count):
            self._told = (description, number, count)
            if self.late:
                if not self.rows:
                    raise TimeLimitError(f"{description}: {self._limit} reached before any answer")
                self.stop(description)
                return
            yield number
            self.progress(description, number + 1, count)

    def record(self, row: Row) -> None:
        """Report a round to the watchers; a resumed iteration reports its earlier rounds too."""
        self.rows.append(row)
        self.watch(self.rows)

    def report_trial(self, description: str) -> None:
        """Report once to the watchers what a round of the iteration tries."""
        if self._told is not None and description != self._tried:
            self._tried = description
            work, done, count = self._told
            self.progress(f"{work}: {description}", done, count)

    def seconds_left(self, description: str) -> float:
        """Seconds until the time limit, infinite without one; raises `TimeLimitError` after it."""
        if self.late:
            raise TimeLimitError(f"{description}: {self._limit} reached")
        return self.remaining

    @property
    def late(self) -> bool:
        """Whether the time limit, less the reserved part, has passed."""
        return self.remaining < 0.0

    def stop(self, description: str) -> None:
        """Record that the time limit ended this work, and that the answer is the best so far."""
        told = len(self.rows)
        after = f"after {told} rounds" if told > 1 else "after 1 round"
        where = after if told else f"in {description}"
        self.stopped = f"{self._limit} reached {where}; best so far"

    @property
    def remaining(self) -> float:
        """Seconds until the time limit, less the reserved part; negative after it."""
        limit = self.options.time_limit
        spent = time.perf_counter() - self.started
        return math.inf if limit is None else limit - self.reserved - spent

    @property
    def _limit(self) -> str:
        return f"time limit of {self.options.time_limit:g} s"
