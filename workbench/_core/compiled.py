"""Compiled loops: Numba functions cached on disk."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from functools import cache
from pathlib import Path
from typing import Any

from workbench._core.machine_code.door import (
    NO_WRAPPERS,
    NOTHING_COUNTED,
    check_releases,
    reason_of,
    tell_plain,
)


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function to machine code at its first call, and cache the code on disk.

    While the compiled function runs, other Python threads can run too.

    Numba looks only at the function's own file to see whether cached code is out of date. It would
    miss a change in a constant or in a function that is called, and run old code. So the time stamp
    here covers every file of the package that the function's file imports, directly or through
    others.

    Cached code names its module. The registry imports problem files under a package of its own,
    which no other process can import by name; their code is cached under separate names.
    """
    return _compile_and_cache(function, {}, {})


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a small function that is called very often and makes no array.

    Numba counts the references to every array argument, which takes longer than the arithmetic of a
    small function. Here the counting is switched off. So a function that makes an array does not
    compile; slices of array arguments are allowed. The compiled code is cached on disk.

    The step of a `workbench.simulation.Controller`, and what it calls, must be compiled by it.

    Examples
    --------
    >>> from workbench.simulation import kernel
    >>> @kernel
    ... def limited(value, limit):
    ...     return min(max(value, -limit), limit)
    >>> limited(3.0, 2.0)
    2.0
    """
    return _compile_and_cache(function, {}, NOTHING_COUNTED)


def inlined(function: Callable[..., Any]) -> Any:
    """As `kernel`, for a function whose code is inserted into its callers.

    A call hands over seven numbers for each array, and the caller's compiler cannot see which of
    them stay the same. Besides, Numba compiles a called function again with each caller, at every
    level of calls.
    """
    return _compile_and_cache(function, {"inline": "always"}, NOTHING_COUNTED)


def unchecked(function: Callable[..., Any]) -> Any:
    """As `compiled`, but a division by zero gives inf or NaN as in NumPy, without a test for it.

    Without that test the compiler can vectorise a loop.
    """
    return _compile_and_cache(function, {"error_model": "numpy"}, {})


def unchecked_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, with the divisions of `unchecked`; only compiled functions can call it.

    The wrapper through which Python would call it is left out: it takes up to half of the
    compilation time.
    """
    return _compile_and_cache(function, {"error_model": "numpy"}, NOTHING_COUNTED | NO_WRAPPERS)


Watcher = Callable[[str, int, int], AbstractContextManager[None]]
"""Called with the name of a function that is being compiled, how many functions of its room have
been compiled, and how many there are.
"""
_watchers: list[Watcher] = []
_IMPORT = re.compile(r"^from[ \t]+(\.*)([\w.]*)[ \t]+import\b", re.MULTILINE)
"""Pattern of a statement that imports names from a module: its leading dots and the
module's name.
"""
_functions: dict[str, int] = {}
"""Number of compiled functions of each room."""


def watched_by(watcher: Watcher) -> None:
    """Enter the watcher's context during each compilation of a function of the project."""
    _watchers.append(watcher)


def compilations(
    begin: Callable[[], None], end: Callable[[], None]
) -> AbstractContextManager[None]:
    """Call ``begin`` before each compilation inside, and ``end`` after it.

    In the plain way no compilation is reported.
    """
    try:
        check_releases()
        from workbench._core.machine_code.events import reported_compilations

        return reported_compilations(begin, end)
    except Exception as error:  # what has changed in Numba may raise any error
        tell_plain("times without compilation", reason_of(error))
        return nullcontext()


@cache
def _listen() -> None:
    """Report Numba's compilations to the watchers."""
    from workbench._core.machine_code.events import report_compilations

    entered: list[ExitStack] = []
    compiled: dict[str, int] = {}

    def begin(function: Callable[..., Any]) -> None:
        room = (function.__module__ or "").rpartition(".")[0]
        entered.append(stack := ExitStack())
        if room in _functions:
            done = compiled[room] = compiled.get(room, 0) + 1
            said = (f"{function.__module__}.{function.__name__}", done, _functions[room])
            for watcher in _watchers:
                stack.enter_context(watcher(*said))

    report_compilations(begin, lambda: entered.pop().close())


def _compile_and_cache(
    function: Callable[..., Any],
    options: dict[str, Any],
    private: dict[str, Any],
) -> Any:
    """Compile with Numba's documented options, and also with private ones if they may be used.

    In the plain way, the code is compiled in every process: Numba's own cache would keep code that
    is out of date.
    """
    import numba

    room = function.__module__.rpartition(".")[0]
    _functions[room] = _functions.get(room, 0) + 1
    try:
        check_releases()
        from workbench._core.machine_code.kept import kept_compiled

        _listen()
        package = function.__module__.partition(".")[0]
        prefix = f"{package}." if sys.modules[package].__spec__ is None else ""
        file = Path(inspect.getfile(function))
        stamp = _stamp(file, file.parents[function.__module__.count(".")], package)
        return kept_compiled(function, {**options, **private}, prefix, stamp)
    except Exception as error:  # what has changed in Numba may raise any error
        tell_plain("compiled functions", reason_of(error))
        njit: Any = numba.njit
        return njit(nogil=True, **options)(function)


@cache
def _stamp(file: Path, root: Path, package: str) -> tuple[tuple[str, int, int], ...]:
    """Names, modification times and sizes of a file and of its package's files that it imports."""
    reached, waiting = set(), [file]
    while waiting:
        one = waiting.pop()
        if one not in reached:
            reached.add(one)
            waiting += _imported_files(one, root, package)
    stats = ((str(one.relative_to(root)), one.stat()) for one in sorted(reached))
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


@cache
def _imported_files(file: Path, root: Path, package: str) -> tuple[Path, ...]:
    """Files of the package from which a file imports names.

    All files of a room if it imports from the room.
    """
    found: list[Path] = []
    for dots, module in _IMPORT.findall(file.read_text(encoding="utf-8")):
        parts = module.split(".") if module else []
        if not dots and parts[0] != package:
            continue
        folder = file.parents[len(dots) - 1] if dots else root
        place = folder.joinpath(*parts)
        if place.is_dir():
            found += sorted(place.glob("*.py"))
        elif place.with_suffix(".py").is_file():
            found.append(place.with_suffix(".py"))
    return tuple(found)
