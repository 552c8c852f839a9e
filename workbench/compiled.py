"""Compiled loops: Numba functions cached on disk."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function to machine code at its first call, and keep that on disk.

    While it runs, other threads of Python do.

    A compiled function may call compiled functions of its own room only. Numba looks for changes
    in the function's own file alone; a change in a sibling that it calls would go unseen and old
    code would run. So the stamp it compares covers every file of the room.
    """
    from numba import njit

    try:
        dispatcher: Any = njit(cache=True, nogil=True)(function)
    except RuntimeError:  # nowhere to keep it: compile in every process
        return njit(nogil=True)(function)
    dispatcher._cache._cache_file._source_stamp = _stamp(Path(inspect.getfile(function)).parent)
    return dispatcher


@cache
def _stamp(room: Path) -> tuple[tuple[str, int, int], ...]:
    """Name, time of change and size of every source file of a room."""
    stats = ((file.name, file.stat()) for file in sorted(room.glob("*.py")))
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)
