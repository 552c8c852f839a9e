"""Compiled functions that are kept on disk with a time stamp of our own."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

import numba
from filelock import FileLock
from numba.core.compiler_lock import global_compiler_lock as _global_compiler_lock

global_compiler_lock: Any = _global_compiler_lock
njit: Any = numba.njit  # its annotations lack its undocumented options
LONGEST_COMPILATION = 600.0
"""Time [s] to wait for another process that compiles the same function."""


def kept_compiled(
    function: Callable[..., Any], options: dict[str, Any], prefix: str, stamp: tuple[Any, ...]
) -> Any:
    """Compile a function at its first call, and keep the code until the stamp changes.

    The prefix is put before the name under which the code is kept.
    """
    try:
        dispatcher = njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # no folder can hold the cache: compile in every process
        return njit(nogil=True, **options)(function)
    cache = dispatcher._cache
    name = f"{prefix}{cache._impl.filename_base}"
    cache._cache_file = type(cache._cache_file)(cache._cache_path, name, stamp)
    dispatcher.compile = partial(_compile_once, dispatcher, dispatcher.compile)
    return dispatcher


def _compile_once(dispatcher: Any, compile_: Callable[[Any], Any], signature: Any) -> Any:
    """Compile a function, unless another process is compiling it: then wait and load its result.

    No two processes can wait for each other: one thread of a process compiles at a time, and it
    takes the locks in the order of calls, the caller's before those of the functions it calls.
    Where locks are not available, two processes may compile the same function.
    """
    with global_compiler_lock, ExitStack() as held:
        cache = dispatcher._cache
        key = cache._index_key(signature, dispatcher.targetctx.codegen())
        if key not in cache._cache_file._load_index():
            # a read-only folder, no locks, or a `Timeout`
            with suppress(OSError, NotImplementedError):
                lock = f"{cache._cache_file._index_path}.lock"
                held.enter_context(FileLock(lock, timeout=LONGEST_COMPILATION))
        return compile_(signature)
