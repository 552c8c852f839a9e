"""One function of many items, spread over an executor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, as_completed, wait
from typing import Any, TypeVar

from workbench.errors import ClusterError, InputError
from workbench.executor.progress import Progress, no_progress

S = TypeVar("S")
T = TypeVar("T")


def spread(
    function: Callable[[T], S],
    items: Sequence[T],
    executor: Executor,
    *,
    progress: Progress = no_progress,
    description: str = "",
    batch: int = 1,
) -> list[S]:
    """Results of a function of many items, in their order; `batch` items make one task.

    The first error that occurs is raised, and tasks that have not begun are dropped. Raises
    InputError for a batch below 1.

    Examples
    --------
    >>> from workbench.executor import InProcess, spread
    >>> told = []
    >>> progress = lambda what, done, total: told.append((done, total))
    >>> spread(abs, [-1, 2, -3], InProcess(), progress=progress), told[-1]
    ([1, 2, 3], (3, 3))
    """
    if batch < 1:
        raise InputError(f"batch is {batch}; it must be 1 or more")
    sizes: dict[Future[list[S]], int] = {}
    told: set[Future[list[S]]] = set()

    def tell(future: Future[list[S]]) -> None:
        future.result()
        told.add(future)
        progress(description, sum(sizes[one] for one in told), len(items))

    progress(description, 0, len(items))
    try:
        for start in range(0, len(items), batch):
            part = items[start : start + batch]
            future = executor.submit(_each, function, part)
            sizes[future] = len(part)
            if future.done():  # in process, a task ends before the next one begins
                tell(future)
        for future in as_completed(sizes):
            if future not in told:
                tell(future)
    finally:
        for future in sizes:
            future.cancel()
    return [result for future in sizes for result in future.result()]


def _each(function: Callable[[T], S], items: Sequence[T]) -> list[S]:
    return [function(item) for item in items]


def finished_calls(
    executor: Executor, calls: Iterable[tuple[T, tuple[Any, ...]]], *, window: int | None = None
) -> Iterator[tuple[T, Future[Any]]]:
    """Yield labels and finished futures of many calls, as they end.

    A call is a label with a function and its arguments. At most ``window`` calls are waiting or
    running at a time, so that a hundred thousand calls take no more memory than a hundred; None: as
    many as the executor wants, or 64. If the caller stops iterating, calls that have not begun are
    cancelled. Raises ClusterError if the executor's cluster is lost, since then no call is to
    blame.

    Examples
    --------
    >>> from workbench.executor import InProcess, finished_calls
    >>> calls = [("a", (abs, -1)), ("b", (max, 2, 3))]
    >>> {label: future.result() for label, future in finished_calls(InProcess(), calls)}
    {'a': 1, 'b': 3}
    """
    waiting = iter(calls)
    most: int = getattr(executor, "window", 64) if window is None else window
    labels: dict[Future[Any], T] = {}
    try:
        while True:
            while len(labels) < most:
                label, call = next(waiting, (None, None))
                if call is None:
                    break
                future = executor.submit(*call)
                if future.done():  # in process, a task ends before the next one begins
                    _need_cluster(future)
                    yield label, future  # type: ignore[misc]
                else:
                    labels[future] = label  # type: ignore[assignment]
            if not labels:
                return
            for future in wait(labels, return_when=FIRST_COMPLETED).done:
                _need_cluster(future)
                yield labels.pop(future), future
    finally:
        for future in labels:
            future.cancel()


def _need_cluster(future: Future[Any]) -> None:
    error = None if future.cancelled() else future.exception()
    if isinstance(error, ClusterError):
        raise error
