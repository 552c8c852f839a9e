"""Compilations by Numba, reported as they begin and end."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from numba.core import event as _event

event: Any = _event  # Numba's event module has no annotations.
COMPILATION = "numba:compile"


def _listener(begin: Callable[[Any], None], end: Callable[[], None]) -> Any:
    """Listener that calls ``begin`` with the function to be compiled, and ``end`` after it.

    Compilations are nested: the functions that a function calls are compiled within it. Code that
    is loaded from disk is not reported.
    """

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            begin(event.data["dispatcher"].py_func)

        def on_end(self, event: Any) -> None:
            end()

    return Listener()


def report_compilations(begin: Callable[[Any], None], end: Callable[[], None]) -> None:
    """Report compilations for the rest of the process."""
    event.register(COMPILATION, _listener(begin, end))


def reported_compilations(
    begin: Callable[[Any], None], end: Callable[[], None]
) -> AbstractContextManager[None]:
    """Report compilations inside a ``with`` statement."""
    listening: AbstractContextManager[None] = event.install_listener(
        COMPILATION, _listener(begin, end)
    )
    return listening
