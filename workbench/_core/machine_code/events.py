"""Compilations by Numba, reported as they begin and end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from numba.core import event as _event

event: Any = _event  # Numba's event module has no annotations.
COMPILATION = "numba:compile"


def _listener(begin: Callable[[Any], None], end: Callable[[], None]) -> Any:
    """Listener that calls ``begin`` with the event of a compilation, and ``end`` after it.

    Compilations are nested: the functions that a function calls are compiled within it. Code that
    is loaded from disk is not reported.
    """

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            begin(event)

        def on_end(self, event: Any) -> None:
            end()

    return Listener()


def report_compilations(begin: Callable[[Any], None], end: Callable[[], None]) -> None:
    """For the rest of the process, call ``begin`` with each function that will be compiled."""
    told = _listener(lambda event: begin(event.data["dispatcher"].py_func), end)
    event.register(COMPILATION, told)


def reported_compilations(
    begin: Callable[[], None], end: Callable[[], None]
) -> AbstractContextManager[None]:
    """Call ``begin`` and ``end`` for each compilation inside a ``with`` statement."""
    told = _listener(lambda event: begin(), end)
    listening: AbstractContextManager[None] = event.install_listener(COMPILATION, told)
    return listening
