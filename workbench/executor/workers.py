"""A pool of processes that are started once; each can be killed without harm to the others."""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from workbench.errors import (
    CrashedError,
    InputError,
    MemoryLimitError,
    TimeLimitError,
    WorkbenchError,
)
from workbench.executor.worker import last_words, task_bytes

T = TypeVar("T")

THREADS = (
    *("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"),
    *("RAYON_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"),
)
"""Environment variables that limit the threads of linear algebra, of compiled loops and
of solvers.
"""
SERVE = "import sys; from workbench.executor.worker import serve; serve(sys.argv[1])"
"""Program of each process of the pool."""
KILLS = 2
"""Number of workers whose death makes a task count as crashed: the first may have died
by chance.
"""
LOOK = 0.05
"""Time between two looks at the memory of a worker [s]."""


class Workers(Executor):
    """Runs tasks in processes that are reused, and replaces a process that is killed or dies.

    A task may say how long it has left (`workbench.executor.worker.alarm`). It is killed after that
    time, and its future raises `TimeLimitError`. A task whose worker dies is repeated by another
    worker; if that one dies too, its future raises `CrashedError`. An error of a task becomes a
    WorkbenchError with the same text.

    Parameters
    ----------
    count
        Number of processes.
    threads
        Threads that linear algebra and solvers may use in each.
    memory_limit
        Resident memory of a process [byte] beyond which it is killed and the task's future raises
        `MemoryLimitError`; None: no limit.
    preload
        Modules that a process imports before its first task.

    Examples
    --------
    >>> from workbench.executor import Workers, spread
    >>> with Workers(count=1) as workers:
    ...     print(spread(abs, [-1, 2, -3], workers, batch=3))
    ...
    [1, 2, 3]
    """

    def __init__(
        self,
        *,
        count: int = 1,
        threads: int = 1,
        memory_limit: int | None = None,
        preload: Sequence[str] = (),
    ) -> None:
        for name, value in (("count", count), ("threads", threads), ("memory_limit", memory_limit)):
            if value is not None and value < 1:
                raise InputError(f"{name} of workers must be 1 or more, not {value!r}")
        self.threads, self.memory_limit = threads, memory_limit
        self._preload = tuple(preload)
        self._tasks: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._closed = threading.Event()
        self._seats = [_Seat(self) for _ in range(count)]

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        if self._closed.is_set():
            raise RuntimeError("these workers are shut down")
        future: Future[T] = Future()
        try:
            self._tasks.put(_Task(task_bytes(fn, args, kwargs), future))
        except Exception as error:
            future.set_exception(InputError(f"the task cannot be sent to a process: {error}"))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._closed.set()
        if cancel_futures:
            self._cancel()
        for _ in self._seats:
            self._tasks.put(None)
        if wait:
            for seat in self._seats:
                seat.thread.join()

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if kind is not None:  # nobody waits for the running tasks
            self._cancel()
            for seat in self._seats:
                seat.kill()
        self.shutdown()

    def _cancel(self) -> None:
        while True:
            try:
                task = self._tasks.get_nowait()
            except queue.Empty:
                return
            if task is not None:
                task.future.cancel()

    def start(self, file: Path) -> subprocess.Popen[bytes]:
        """Start a process that serves tasks and prints into a file."""
        threads = dict.fromkeys(THREADS, str(self.threads))
        process = subprocess.Popen(
            [sys.executable, "-c", SERVE, str(file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | threads | {"PYTHONPATH": search_path()},
        )
        assert process.stdin is not None
        pickle.dump((sys.path, self._preload), process.stdin)
        process.stdin.flush()
        return process


def search_path() -> str:
    """Path on which a new process finds the workbench; it receives the rest of the path later."""
    home = str(Path(__file__).parents[2])
    return os.pathsep.join([home, *filter(None, [os.environ.get("PYTHONPATH")])])


@dataclass
class _Task:
    content: bytes
    future: Future[Any]


class _Seat:
    """A thread that hands out tasks to a process, and starts a new process if that one dies."""

    def __init__(self, pool: Workers) -> None:
        self._pool = pool
        self._process: subprocess.Popen[bytes] | None = None
        # The process's own number, once it has told it. In a virtual environment of Windows the
        # program that was started is a launcher; Python is another process, and that one's memory
        # counts.
        self._number = 0
        self._heard: queue.SimpleQueue[tuple[str, Any] | None] = queue.SimpleQueue()
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()

    def _serve(self) -> None:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            self._file = Path(folder) / "printed"
            self._file.touch()
            try:
                self._seat()
                while (task := self._pool._tasks.get()) is not None:
                    if task.future.set_running_or_notify_cancel():
                        self._do(task)
            finally:
                self._leave()

    def _do(self, task: _Task) -> None:
        died = ""
        for _ in range(KILLS):
            try:
                value = self._ask(task.content)
            except _DiedError as death:
                died = str(death)
                self._leave()
                if self._pool._closed.is_set():
                    break
                self._seat()
            except WorkbenchError as error:
                task.future.set_exception(error)
                if self._process is None and not self._pool._closed.is_set():
                    self._seat()  # it starts while nobody waits for it
                return
            else:
                task.future.set_result(value)
                return
        task.future.set_exception(CrashedError(died))

    def _seat(self) -> None:
        """Start a process; the first caller waits until it is ready."""
        self._process = self._pool.start(self._file)
        self._ready = False
        self._heard = queue.SimpleQueue()
        self._number = self._process.pid
        listener = threading.Thread(target=_hear, args=(self._process, self._heard), daemon=True)
        listener.start()

    def _leave(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with suppress(OSError):
                    stream.close()

    def _ask(self, content: bytes) -> Any:
        """The value of a task, or the error that it raised."""
        if self._process is None:
            self._seat()
        process = self._process
        assert process is not None and process.stdin is not None
        try:
            while not self._ready:
                _, self._number = self._next(process, None)
                self._ready = True
            pickle.dump(content, process.stdin)
            process.stdin.flush()
        except OSError:  # it has died meanwhile
            raise self._died(process) from None
        until, reason = None, ""
        while True:
            kind, value = self._next(process, until, reason)
            if kind == "value":
                return pickle.loads(value)
            if kind == "error":
                raise WorkbenchError(value)
            seconds, reason = value
            until = None if seconds is None else time.monotonic() + seconds

    def _next(
        self, process: subprocess.Popen[bytes], until: float | None, reason: str = ""
    ) -> tuple[str, Any]:
        """The next message of a process, which must not exceed this time or the memory limit.

        ``reason`` becomes the message of a process that is killed at its time limit.
        """
        allowed = self._pool.memory_limit
        while True:
            left = None if until is None else max(0.0, until - time.monotonic())
            pause = left if allowed is None else min(LOOK, LOOK if left is None else left)
            try:
                message = self._heard.get(timeout=pause)
            except queue.Empty:
                if until is not None and time.monotonic() >= until:
                    self._leave()
                    raise TimeLimitError(reason) from None
                if allowed is not None and _resident(self._number) > allowed:
                    self._leave()
                    raise MemoryLimitError(
                        f"killed at its memory limit of {allowed / 2**20:.4g} MiB"
                    ) from None
                continue
            if message is None:
                raise self._died(process)
            return message

    def _died(self, process: subprocess.Popen[bytes]) -> _DiedError:
        process.wait()
        words = last_words(self._file).strip()
        said = f": {words[-500:]}" if words else ""
        return _DiedError(f"the worker process died with exit code {process.returncode}{said}")


class _DiedError(Exception):
    """The process of a task died."""


def _hear(process: subprocess.Popen[bytes], heard: queue.SimpleQueue[Any]) -> None:
    """Pass on the messages of a process; None when they end."""
    assert process.stdout is not None
    try:
        while True:
            heard.put(pickle.load(process.stdout))
    except (EOFError, OSError, ValueError, pickle.UnpicklingError):
        heard.put(None)


def _resident(process: int) -> int:
    """Resident memory of a process [byte]; 0 for one that is gone."""
    import psutil

    try:
        return int(psutil.Process(process).memory_info().rss)
    except psutil.Error:
        return 0
