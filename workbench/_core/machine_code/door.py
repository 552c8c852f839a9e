"""The door to private parts of Numba and LLVM: when they are used, and the plain way otherwise.

A *fast road* is code that uses private members of Numba and llvmlite, which may change in any
release. It is taken if three things are true: the installed releases were tested, its modules can
be imported, and its self-test gives the known answers. Otherwise ordinary Numba functions compute
the same answers more slowly (the *plain way*), and the user is told once.
"""

from __future__ import annotations

import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

RELEASES = {"numba": ((0, 61), (0, 69)), "llvmlite": ((0, 44), (0, 51))}
"""For each package the oldest tested release, and the first release after the tested ones."""
NOTHING_COUNTED: dict[str, Any] = {"_nrt": False}
"""Undocumented option of Numba: references to arrays are not counted."""
NO_WRAPPERS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Undocumented options of Numba: only compiled functions can call the function."""


def check_releases() -> None:
    """Raise ImportError for a release of Numba or llvmlite that was not tested."""
    import llvmlite
    import numba

    for package in (numba, llvmlite):
        name, found = package.__name__, package.__version__
        first, beyond = RELEASES[name]
        if not first <= _release(found) < beyond:
            span = " to below ".join(".".join(map(str, one)) for one in (first, beyond))
            raise ImportError(f"{name} {found} was not tested, {span} was")


def _release(version: str) -> tuple[int, ...]:
    """Major and minor number of a version; (0, 0) for a version that has none."""
    found = re.match(r"(\d+)\.(\d+)", version)
    return tuple(map(int, found.groups())) if found else (0, 0)


_told: set[str] = set()
_plain = 0


def reason_of(error: Exception) -> str:
    """Type and message of an error."""
    return f"{type(error).__name__}: {error}"


def tell_plain(what: str, reason: str) -> None:
    """Warn that something is done in the plain way, once for each reason."""
    if reason not in _told:
        _told.add(reason)
        message = f"{what}: plain code is used, slower and with the same results ({reason})"
        warnings.warn(message, RuntimeWarning, stacklevel=2)


@contextmanager
def plain_way() -> Iterator[None]:
    """Take no fast road inside the block, in any thread, to compare answers and times."""
    global _plain
    _plain += 1
    try:
        yield
    finally:
        _plain -= 1


class Road:
    """A fast road: the task that it serves, and a function that imports, tests and returns it.

    The function raises an error where something cannot be imported or gives a wrong answer.
    """

    def __init__(self, what: str, tested: Callable[[], Any]) -> None:
        self.what, self.reason = what, ""
        self._tested, self._lock = tested, threading.Lock()
        self._tried = False
        self._road: Any = None

    def taken(self) -> Any:
        """The result of the function; None if the plain way must be taken.

        The first call makes the self-test. Other threads wait for it, so that no two of them
        compile the same functions.
        """
        if _plain:
            return None
        with self._lock:
            if not self._tried:
                try:
                    check_releases()
                    self._road = self._tested()
                except Exception as error:  # what has changed in a package may raise any error
                    self.reason = reason_of(error)
                self._tried = True
                if self.reason:
                    tell_plain(self.what, self.reason)
            return self._road
