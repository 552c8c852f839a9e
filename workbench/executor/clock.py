"""The clock of the running work: an inner loop can look at it without being given it.

A method's search ends at its time limit. The proof of its result may take longer, unless a time is
set for the proof too.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from workbench.errors import TimeLimitError

if TYPE_CHECKING:
    from workbench.executor.context import Context

_running: ContextVar[tuple[Context, ...]] = ContextVar("running", default=())
"""The contexts of the work that runs now, the outermost first."""
_proof_ends: ContextVar[float] = ContextVar("proof_ends", default=math.inf)
"""Time at which a proof must have ended, on the clock of `time.perf_counter`."""


@contextmanager
def clocked_by(context: Context) -> Iterator[None]:
    """Inside, `tick` and `time_is_up` look at this context's clock and those of enclosing ones.

    Examples
    --------
    >>> from workbench import Options
    >>> from workbench.errors import TimeLimitError
    >>> from workbench.executor import Context
    >>> from workbench.executor.clock import clocked_by, tick
    >>> try:
    ...     with clocked_by(Context(options=Options(time_limit=1e-9))):
    ...         tick("search")
    ... except TimeLimitError as error:
    ...     print(error)
    search: time limit of 1e-09 s reached
    """
    token = _running.set((*_running.get(), context))
    try:
        yield
    finally:
        _running.reset(token)


def tick(description: str) -> None:
    """Raise TimeLimitError, with this description of the work, if no time is left.

    A loop whose parts can take a second calls it once for each part. Watchers are told of the call.

    Examples
    --------
    >>> from workbench.executor.clock import tick
    >>> tick("search")  # nothing runs that has a time limit
    """
    contexts = _running.get()
    for context in contexts:
        context.seconds_left(description)
    for context in contexts[:1]:
        context.report_trial(description)


def time_is_up(description: str) -> bool:
    """Whether no time is left; if so, the context records that the answer is the best so far.

    For loops that have an answer after each part, though perhaps not the best one.

    Examples
    --------
    >>> from workbench.executor.clock import time_is_up
    >>> time_is_up("search")
    False
    """
    late = [context for context in _running.get() if context.late]
    for context in late:
        context.stop(description)
    return bool(late)


@contextmanager
def proving(seconds: float) -> Iterator[None]:
    """Inside, a proof that takes longer than so many seconds is given up at its next `proof_tick`.

    Examples
    --------
    >>> from workbench.errors import TimeLimitError
    >>> from workbench.executor.clock import proof_tick, proving
    >>> try:
    ...     with proving(0.0):
    ...         proof_tick("proof of a peak")
    ... except TimeLimitError as error:
    ...     print(error)
    proof of a peak: no time is left for it
    """
    token = _proof_ends.set(min(_proof_ends.get(), time.perf_counter() + seconds))
    try:
        yield
    finally:
        _proof_ends.reset(token)


def proof_tick(description: str) -> None:
    """Raise TimeLimitError, with this description of the proof, if the time for it is over.

    Examples
    --------
    >>> from workbench.executor.clock import proof_tick
    >>> proof_tick("proof of a peak")  # it may take as long as it takes
    """
    if time.perf_counter() > _proof_ends.get():
        raise TimeLimitError(f"{description}: no time is left for it")
