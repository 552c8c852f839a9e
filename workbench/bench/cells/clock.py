"""The clock of a cell: it kills at the limit, and stands still while functions are compiled."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from workbench.executor.worker import alarm


class Clock:
    """How long a cell has left, why it is killed then, and what was spent on compiling [s]."""

    def __init__(self, limit: float | None, reason: str) -> None:
        self.compiling = 0.0
        self._left, self._reason, self._depth = limit, reason, 0
        self._since = time.monotonic()
        alarm(limit, reason)

    def stop(self) -> None:
        """A function is being compiled; it may need others for that."""
        self._depth += 1
        if self._depth == 1:
            if self._left is not None:
                self._left = max(0.0, self._left - (time.monotonic() - self._since))
            self._since = time.monotonic()
            alarm(None)

    def go_on(self) -> None:
        """It is compiled."""
        self._depth -= 1
        if self._depth == 0:
            now = time.monotonic()
            self.compiling += now - self._since
            self._since = now
            alarm(self._left, self._reason)


@contextmanager
def running(limit: float | None, reason: str) -> Iterator[Clock]:
    """Have this process killed after so many seconds inside, those of compiling not counted.

    Whoever waits for it is told the reason.
    """
    from numba.core import event

    class Compiler(event.Listener):
        def on_start(self, event: Any) -> None:
            clock.stop()

        def on_end(self, event: Any) -> None:
            clock.go_on()

    clock = Clock(limit, reason)
    try:
        with event.install_listener("numba:compile", Compiler()):
            yield clock
    finally:
        alarm(None)
