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
    """Compile a function to machine code at its first call, and cache the code on disk.

    While the compiled function runs, other Python threads can run too.

    Numba looks only at the function's own file to see whether cached code is out of date. It would
    miss a change in a constant or in a function that is called, and run old code. So the time stamp
    here covers every file of the package that the function's file imports, directly or through
    others.

    Cached code names its module. The registry imports problem files under a package of its own,
    which no other process can import by name; their code is cached under separate names.
    """
    return _compile_and_cache(function, {})


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
    return _compile_and_cache(function, {"_nrt": False})


def inlined(function: Callable[..., Any]) -> Any:
    """As `kernel`, for a function whose code is inserted into its callers.

    A call hands over seven numbers for each array, and the caller's compiler cannot see which of
    them stay the same. Besides, Numba compiles a called function again with each caller, at every
    level of calls.
    """
    return _compile_and_cache(function, {"_nrt": False, "inline": "always"})


def unchecked(function: Callable[..., Any]) -> Any:
    """As `compiled`, but a division by zero gives inf or NaN as in NumPy, without a test for it.

    Without that test the compiler can vectorise a loop.
    """
    return _compile_and_cache(function, {"error_model": "numpy"})


def unchecked_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, with the divisions of `unchecked`; only compiled functions can call it.

    The wrapper through which Python would call it is left out: it takes up to half of the
    compilation time.
    """
    options = {"_nrt": False, "error_model": "numpy"}
    return _compile_and_cache(
        function, {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    )


Watcher = Callable[[str, int, int], AbstractContextManager[None]]
"""Called with the name of a function that is being compiled, how many functions of its room have
been compiled, and how many there are.
"""
_watchers: list[Watcher] = []
LONGEST_COMPILATION = 600.0
"""Time [s] to wait for another process that compiles the same function."""
_IMPORT = re.compile(r"^from[ \t]+(\.*)([\w.]*)[ \t]+import\b", re.MULTILINE)
"""Pattern of a statement that imports names from a module: its leading dots and the
module's name.
"""
_functions: dict[str, int] = {}
"""Number of compiled functions of each room."""


def watched_by(watcher: Watcher) -> None:
    """Enter the watcher's context during each compilation of a function of the project."""
    _watchers.append(watcher)


@cache
def _listen() -> None:
    """Report Numba's compilations to the watchers; loading code from disk is not reported."""
    from numba.core import event

    class Listener(event.Listener):
        """Follows Numba's compilations, which nest: a function's callees are compiled within it."""

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

    events: Any = event  # Numba's event module has no annotations
    events.register("numba:compile", Listener())


def _compile_and_cache(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    import numba

    _listen()
    room = function.__module__.rpartition(".")[0]
    _functions[room] = _functions.get(room, 0) + 1
    njit: Any = numba.njit  # njit's annotations lack its undocumented options
    try:
        dispatcher = njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # no folder can hold the cache: compile in every process
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
    """Compile a function, unless another process is compiling it: then wait and load its result.

    No two processes can wait for each other: one thread of a process compiles at a time, and it
    takes the locks in the order of calls, the caller's before those of the functions it calls.
    Where locks are not available, two processes may compile the same function.
    """
    from filelock import FileLock
    from numba.core.compiler_lock import global_compiler_lock

    with global_compiler_lock, ExitStack() as held:
        kept = dispatcher._cache
        key = kept._index_key(signature, dispatcher.targetctx.codegen())
        if key not in kept._cache_file._load_index():
            # a read-only folder, no locks, or a `Timeout`
            with suppress(OSError, NotImplementedError):
                lock = FileLock(f"{kept._cache_file._index_path}.lock", timeout=LONGEST_COMPILATION)
                held.enter_context(lock)
        return compile_(signature)


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
