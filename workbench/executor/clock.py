"""The clock of the work that runs: an inner loop looks at it without being handed it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.executor.context import Context

_running: ContextVar[tuple[Context, ...]] = ContextVar("running", default=())
"""The contexts of what runs here, the outermost first."""


@contextmanager
def running(context: Context) -> Iterator[None]:
    """Within it `tick` and `time_is_up` look at the clock of a context, and at those around it.

    Examples
    --------
    >>> from workbench import Options
    >>> from workbench.errors import TimeLimitError
    >>> from workbench.executor import Context
    >>> from workbench.executor.clock import running, tick
    >>> try:
    ...     with running(Context(Options(time_limit=1e-9))):
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
    """Raise TimeLimitError, which names what was done, where no time is left.

    A loop whose parts can take a second calls it once for each part.

    Examples
    --------
    >>> from workbench.executor.clock import tick
    >>> tick("search")  # nothing runs that has a time limit
    """
    for context in _running.get():
        context.seconds_left(description)


def time_is_up(description: str) -> bool:
    """Whether no time is left; then what was done is named as what the clock stopped.

    For a loop that has an answer after each part, if not the best one.

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
