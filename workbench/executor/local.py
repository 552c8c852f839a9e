"""Executors that run tasks in the caller's own process."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")


class InProcess(Executor):
    """Runs every task immediately, in the caller's thread.

    Examples
    --------
    >>> from workbench.executor import InProcess, spread
    >>> spread(abs, [-1, 2, -3], InProcess())
    [1, 2, 3]
    """

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@cache
def _controller(scipy: bool) -> ThreadpoolController:
    """Controller of BLAS's threads, which takes long to find; SciPy comes with its own BLAS."""
    return ThreadpoolController()


class Threads(ThreadPoolExecutor):
    """Runs tasks in threads of the caller's process, for compiled code that lets other threads run.

    BLAS is limited to one thread meanwhile: its own threads would keep the cores busy while they
    wait.

    Examples
    --------
    >>> from workbench.executor import Threads, spread
    >>> with Threads(workers=2) as threads:
    ...     print(spread(abs, [-1, 2, -3], threads))
    ...
    [1, 2, 3]
    """

    def __init__(self, *, workers: int | None = None) -> None:
        super().__init__(os.cpu_count() if workers is None else workers)
        self._limits = _controller("scipy.linalg" in sys.modules).limit(limits=1, user_api="blas")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._limits.restore_original_limits()
