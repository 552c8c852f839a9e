"""Compiled loops: Numba functions cached on disk."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function to machine code at its first call, and keep that on disk.

    While it runs, other threads of Python do.

    Numba looks for changes in the function's own file alone; a change in a function that it calls,
    or in a constant, would go unseen and old code would run. So the stamp it compares covers every
    file of the package that the function's file imports, and those that these import.

    What is kept names the module it came from. The registry imports problem files under a package
    of its own, which no other process can import by name; what it compiles is kept apart.
    """
    return _kept(function, {})


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a small function that is called very often and makes no array.

    Numba counts the references to every array that a function is given, which takes longer than
    the arithmetic of a small function. Here that is switched off, so a function that makes an array
    does not compile; slices of given arrays are allowed. Otherwise as `compiled`.
    """
    return _kept(function, {"_nrt": False})


def inlined(function: Callable[..., Any]) -> Any:
    """As `kernel`, for a function that is to become a part of those that call it.

    A call hands over seven numbers for each array, and hides from the caller which of them stay.
    Besides, Numba compiles what a function calls once more with it, at every level of calls.
    """
    return _kept(function, {"_nrt": False, "inline": "always"})


def unchecked(function: Callable[..., Any]) -> Any:
    """As `compiled`, where a division by zero gives what it gives in NumPy, and is not looked for.

    That lets a loop become vector instructions.
    """
    return _kept(function, {"error_model": "numpy"})


def unchecked_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, with the divisions of `unchecked`, for compiled functions alone to call.

    What would let Python call it takes up to half of the time of its compilation, and is left out.
    """
    options = {"_nrt": False, "error_model": "numpy"}
    return _kept(function, {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True})


Watcher = Callable[[str, int, int], AbstractContextManager[None]]
"""Given the name of a function that is compiled, how many of its room are, and how many it has."""
_watchers: list[Watcher] = []
LONGEST_COMPILATION = 600.0
"""Time [s] to wait for another process that compiles the same function."""
_IMPORT = re.compile(r"^from[ \t]+(\.*)([\w.]*)[ \t]+import\b", re.MULTILINE)
"""Statements that import names from a module of the package; dots, and its name."""
_functions: dict[str, int] = {}
"""Number of compiled functions of each room."""


def watched_by(watcher: Watcher) -> None:
    """Have a context entered whenever a function of the project is compiled anew."""
    _watchers.append(watcher)


@cache
def _listen() -> None:
    """Report compilations of Numba to the watchers; code that is found on disk is not reported."""
    from numba.core import event

    class Listener(event.Listener):
        """Compilation is locked: one at a time, but a function compiles what it calls."""

        def __init__(self) -> None:
            self._entered: list[ExitStack] = []
            self._compiled: dict[str, int] = {}

        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            room = (function.__module__ or "").rpartition(".")[0]
            self._entered.append(stack := ExitStack())
            if room in _functions:
                done = self._compiled[room] = self._compiled.get(room, 0) + 1
                said = (f"{function.__module__}.{function.__name__}", done, _functions[room])
                for watcher in _watchers:
                    stack.enter_context(watcher(*said))

        def on_end(self, event: Any) -> None:
            self._entered.pop().close()

    events: Any = event  # has no annotations
    events.register("numba:compile", Listener())


def _kept(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    import numba

    _listen()
    room = function.__module__.rpartition(".")[0]
    _functions[room] = _functions.get(room, 0) + 1
    njit: Any = numba.njit  # its annotations lack the options that have no documentation
    try:
        dispatcher = njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # nowhere to keep it: compile in every process
        return njit(nogil=True, **options)(function)
    kept = dispatcher._cache
    name, package = kept._impl.filename_base, function.__module__.partition(".")[0]
    if sys.modules[package].__spec__ is None:
        name = f"{package}.{name}"
    file = Path(inspect.getfile(function))
    stamp = _stamp(file, file.parents[function.__module__.count(".")], package)
    kept._cache_file = type(kept._cache_file)(kept._cache_path, name, stamp)
    dispatcher.compile = partial(_compile_once, dispatcher, dispatcher.compile)
    return dispatcher


def _compile_once(dispatcher: Any, compile_: Callable[[Any], Any], signature: Any) -> Any:
    """Compile a function unless another process just does: then wait, and take what it keeps.

    A lock is held while the functions that a function calls are locked in turn, never the other way
    round, and in a process one thread at a time compiles, so no two wait for each other. Where no
    lock can be had, two processes may compile the same.
    """
    from filelock import FileLock
    from numba.core.compiler_lock import global_compiler_lock

    with global_compiler_lock, ExitStack() as held:
        kept = dispatcher._cache
        key = kept._index_key(signature, dispatcher.targetctx.codegen())
        if key not in kept._cache_file._load_index():
            with suppress(OSError, NotImplementedError):  # read-only, no locks; a `Timeout` too
                lock = FileLock(f"{kept._cache_file._index_path}.lock", timeout=LONGEST_COMPILATION)
                held.enter_context(lock)
        return compile_(signature)


@cache
def _stamp(file: Path, root: Path, package: str) -> tuple[tuple[str, int, int], ...]:
    """Name, time of change and size of a file and of all that it imports of its package."""
    reached, waiting = set(), [file]
    while waiting:
        one = waiting.pop()
        if one not in reached:
            reached.add(one)
            waiting += _imported(one, root, package)
    stats = ((str(one.relative_to(root)), one.stat()) for one in sorted(reached))
    return tuple((name, stat.st_mtime_ns, stat.st_size) for name, stat in stats)


@cache
def _imported(file: Path, root: Path, package: str) -> tuple[Path, ...]:
    """Files of the package from which a file imports names; of a room all of them."""
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
