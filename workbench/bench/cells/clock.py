"""The clock of a cell: it kills at the time limit, and stands still during compilation."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from workbench._core.compiled import compilations
from workbench.executor.worker import alarm


class Clock:
    """Time left for a cell, the reason given if it is killed, and the compilation time [s]."""

    def __init__(self, limit: float | None, reason: str) -> None:
        self.compiling = 0.0
        self._left, self._reason, self._depth = limit, reason, 0
        self._since = time.monotonic()
        alarm(limit, reason)

    def stop(self) -> None:
        """Note that a compilation begins; compilations may be nested."""
        self._depth += 1
        if self._depth == 1:
            if self._left is not None:
                self._left = max(0.0, self._left - (time.monotonic() - self._since))
            self._since = time.monotonic()
            alarm(None)

    def go_on(self) -> None:
        """Note that a compilation has ended."""
        self._depth -= 1
        if self._depth == 0:
            now = time.monotonic()
            self.compiling += now - self._since
            self._since = now
            alarm(self._left, self._reason)


@contextmanager
def running(limit: float | None, reason: str) -> Iterator[Clock]:
    """Inside, kill this process after so many seconds, not counting those of compilation.

    The caller that waits for the process is told the reason.
    """
    clock = Clock(limit, reason)
    try:
        with compilations(clock.stop, clock.go_on):
            yield clock
    finally:
        alarm(None)
