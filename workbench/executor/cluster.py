"""An executor that runs tasks on the workers of a Dask scheduler, here or on other machines."""

from __future__ import annotations

import importlib.util
import os
import pickle
import socket
import time
import warnings
from collections.abc import Callable
from concurrent.futures import Executor, Future
from contextlib import suppress
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from workbench.errors import ClusterError, CrashedError, InputError
from workbench.executor.local_cluster import START, LocalCluster
from workbench.executor.worker import task_bytes
from workbench.executor.workers import THREADS

T = TypeVar("T")

LOCAL = "local"
"""Address that stands for a new cluster on this machine."""
ANSWER = 10.0
"""Time within which a scheduler must answer [s]."""
CORES = os.cpu_count() or 1

Arrive = Callable[[], None]
"""Function that each process of a cluster runs before its first task; it refuses to work by raising
an error.
"""


class Cluster(Executor):
    """Runs tasks on the workers of a Dask scheduler.

    A task whose worker dies is repeated by another worker; if that one dies too, the task's future
    raises `CrashedError`. (A scheduler that was started elsewhere counts deaths by its own setting,
    ``allowed-failures`` of Dask.) If the scheduler is lost, finished futures keep their results,
    and all others raise `ClusterError`.

    Parameters
    ----------
    address
        Address of a scheduler, such as "tcp://10.0.0.5:8786"; or "local": processes on this machine
        that end with the executor.
    arrive
        See `Arrive`. Present workers run it at once, workers that join later before their first
        task.
    workers
        Number of processes of a local cluster; None: one for each core.
    threads
        Threads that linear algebra and solvers may use in each task.

    Raises
    ------
    ClusterError
        Dask is not installed, no scheduler answers, or a worker refuses to work.

    Examples
    --------
    >>> from workbench.errors import WorkbenchError
    >>> from workbench.executor import Cluster
    >>> try:
    ...     Cluster("tcp://127.0.0.1:1", None)
    ... except WorkbenchError as error:
    ...     print(type(error).__name__)
    ...
    ClusterError
    """

    def __init__(
        self, address: str, arrive: Arrive, *, workers: int | None = None, threads: int = 1
    ) -> None:
        for name, value in (("workers", workers), ("threads", threads)):
            if value is not None and value < 1:
                raise InputError(f"{name} of a cluster must be 1 or more, not {value!r}")
        if workers is not None and address != LOCAL:
            raise InputError(f"{address} has its own workers: their number cannot be chosen")
        if importlib.util.find_spec("distributed") is None:
            raise ClusterError("Dask is not installed: pip install 'robust-workbench[dask]'")
        self._arrive, self._threads = arrive, threads
        self._own = LocalCluster(workers or CORES) if address == LOCAL else None
        self.address = address if self._own is None else self._own.address
        try:
            self._client = _client(self.address)
        except BaseException:
            self._end_own()
            raise
        try:
            self._welcome()
        except BaseException:
            self.shutdown()
            raise

    def _welcome(self) -> None:
        """Let all present workers run `arrive`; the workers of a local cluster are waited for."""
        from distributed.comm.core import CommClosedError

        try:
            if self._own is not None:
                self._client.wait_for_workers(self._own.workers, timeout=START)
            answers = self._client.run(_arrive_once, self._arrive, self._threads, on_error="return")
        except CommClosedError:
            raise self._lost() from None
        for worker, answer in answers.items():
            if isinstance(answer, BaseException):
                raise ClusterError(f"the worker {worker} cannot work: {_words(answer)}")

    @property
    def window(self) -> int:
        """How many tasks should be waiting or running, so that no worker is idle."""
        # none if the scheduler is lost
        held = self._client.scheduler_info(n_workers=-1).get("workers", {})
        return max(64, 4 * sum(int(worker["nthreads"]) for worker in held.values()))

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            content = task_bytes(fn, args, kwargs)
        except Exception as error:
            future.set_exception(InputError(f"the task cannot be sent to a worker: {error}"))
            return future
        try:
            with warnings.catch_warnings():  # Splitting a large task would not help.
                warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
                there = self._client.submit(_do, content, self._arrive, self._threads, pure=False)
        except Exception as error:
            future.set_exception(self._lost(error))
            return future

        def cancelled_here(ended: Future[T]) -> None:
            if ended.cancelled():
                with suppress(Exception):  # The scheduler may be gone.
                    there.cancel()

        future.add_done_callback(cancelled_here)
        there.add_done_callback(lambda _: self._pass_on(there, future))
        return future

    def _pass_on(self, there: Any, future: Future[Any]) -> None:
        """Copy a task's outcome on the cluster to the caller's future."""
        from distributed.scheduler import KilledWorker

        if not future.set_running_or_notify_cancel():
            return
        try:
            if there.status == "finished":
                future.set_result(there.result(timeout=ANSWER * 6))
                return
            error = there.exception(timeout=ANSWER) if there.status == "error" else None
        # The scheduler was lost after the task ended and before its result arrived.
        except Exception as failure:
            future.set_exception(self._lost(failure))
            return
        if isinstance(error, KilledWorker):
            place = getattr(error.last_worker, "address", error.last_worker)
            error = CrashedError(f"the task's workers died, the last one at {place}")
        future.set_exception(error or self._lost())

    def _lost(self, error: BaseException | None = None) -> ClusterError:
        said = f" ({_words(error)})" if error else ""
        return ClusterError(
            f"the Dask scheduler at {self.address} is lost{said}; what has ended is kept: connect "
            "to another one and ask again"
        )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        del wait, cancel_futures  # Without its client no task continues.
        until = time.monotonic() + 2 * ANSWER
        while self._client.status == "connecting" and time.monotonic() < until:
            time.sleep(0.05)  # The client looks for a lost scheduler for a while, then closes.
        with suppress(Exception):  # the scheduler may be gone
            self._client.close(timeout=ANSWER)
        self._end_own()

    def _end_own(self) -> None:
        if self._own is not None:
            self._own.end()
            self._own = None


def _client(address: str) -> Any:
    from distributed.client import Client
    from distributed.comm.addressing import parse_address, parse_host_port

    try:
        place = parse_host_port(parse_address(address)[1])
        socket.create_connection(place, timeout=ANSWER).close()  # A Client takes long to give up.
        return Client(  # type: ignore[no-untyped-call]
            address, timeout=ANSWER, set_as_default=False
        )
    except (OSError, TimeoutError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler answers at {address}: {_words(error)}") from None


def _words(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"


_home: list[tuple[Arrive, int, Any]] = []
"""What this worker has run on arrival: the function, its number of threads, and the limits set for
them.
"""


def _arrive_once(arrive: Arrive, threads: int) -> None:
    """Run `arrive` once in this process."""
    if _home and _home[0][:2] == (arrive, threads):
        return
    os.environ.update(dict.fromkeys(THREADS, str(threads)))
    arrive()
    _home[:] = [(arrive, threads, threadpool_limits(threads))]


def _do(content: bytes, arrive: Arrive, threads: int) -> Any:
    """Run a task on a worker."""
    _arrive_once(arrive, threads)
    function, arguments, keywords = pickle.loads(content)
    return function(*arguments, **keywords)
