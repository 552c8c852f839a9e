"""One process of a pool of `Workers`: it takes tasks from its input, one after another.

It runs `serve`. Tasks arrive on the standard input and results leave on the standard output, each
as a pickle; what the tasks print goes to a file.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

LONGEST_WORDS = 65_536
"""Most characters of printed output that are read, from its end."""


class _Here:
    """This process as a worker; in any other process it has no channel and no file."""

    results: IO[bytes] | None = None
    printed: Path | None = None


def alarm(seconds: float | None, reason: str = "") -> None:
    """Have this worker killed in so many seconds; None cancels that.

    The pool kills the process, because a solver that hangs in compiled code cannot be asked to
    stop. Then the task's future raises `TimeLimitError` with the reason, or with these seconds as
    its time limit. Outside a worker this does nothing.
    """
    if in_worker():
        limit = "" if seconds is None else f"killed at its time limit of {seconds:.4g} s"
        _send(("alarm", (seconds, reason or limit)))


def in_worker() -> bool:
    """Whether this process is a worker of a pool."""
    return _Here.results is not None


def printed() -> str:
    """The text that the current task has printed so far; empty outside a worker."""
    if _Here.printed is None:
        return ""
    sys.stdout.flush()
    sys.stderr.flush()
    return last_words(_Here.printed)


def last_words(file: Path) -> str:
    """The end of a text that may be long."""
    with file.open("rb") as stream:
        stream.seek(max(0, file.stat().st_size - LONGEST_WORDS))
        return stream.read().decode("utf-8", "replace")


def _send(message: tuple[str, Any]) -> None:
    assert _Here.results is not None
    content = pickle.dumps(message)  # pickled completely before the first byte is sent
    _Here.results.write(content)
    _Here.results.flush()


def _answer(task: bytes) -> tuple[str, Any]:
    try:
        function, arguments, keywords = pickle.loads(task)
        return "value", pickle.dumps(function(*arguments, **keywords))
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else error.code is not None
        os._exit(int(code))  # the task asked to exit; its pool sees a worker that died
    except BaseException as error:  # A Rust panic is not derived from Exception.
        return "error", f"{type(error).__name__}: {error}"


def _tasks(stream: IO[bytes], waiting: queue.SimpleQueue[bytes]) -> None:
    """Pass tasks on; if the pool at the other end is gone, end this process."""
    try:
        while True:
            waiting.put(pickle.load(stream))
    finally:
        os._exit(0)


def die_with_parent() -> None:
    """End with the parent process, where the system supports that.

    So a hung solver does not outlive a killed pool.
    """
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def serve(file: str) -> None:
    """Serve until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the pool handles interrupts
    die_with_parent()
    tasks = os.fdopen(os.dup(0), "rb")
    _Here.results = os.fdopen(os.dup(1), "wb")
    _Here.printed = Path(file)
    out = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for standard in (1, 2):
        os.dup2(out, standard)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    path, preload = pickle.load(tasks)
    sys.path[:] = path
    for module in preload:
        importlib.import_module(module)
    waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_tasks, args=(tasks, waiting), daemon=True).start()
    _send(("ready", os.getpid()))
    while True:
        task = waiting.get()
        os.truncate(file, 0)
        _send(_answer(task))


def task_bytes(function: Callable[..., Any], arguments: Any, keywords: Any) -> bytes:
    """A task as it is sent: importable functions by name, others as code."""
    import cloudpickle

    return bytes(cloudpickle.dumps((function, arguments, keywords)))
