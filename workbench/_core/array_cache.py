"""A cache for a function's results, limited by memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from functools import wraps
from threading import Lock
from typing import Any, ParamSpec, TypeVar

import numpy as np

P = ParamSpec("P")
T = TypeVar("T")


def array_cache(megabytes: float) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Keep the latest results of a function, up to `megabytes` in total.

    `functools.lru_cache` limits the number of results; here many short series or a few long ones
    are kept. The function must return an array or a tuple of arrays, and its arguments must be
    hashable.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.study import array_cache
    >>> @array_cache(megabytes=1)
    ... def squares(count):
    ...     print("computed")
    ...     return np.arange(count) ** 2
    >>> squares(3).tolist(), squares(3).tolist()
    computed
    ([0, 1, 4], [0, 1, 4])
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        results: OrderedDict[Hashable, tuple[T, int]] = OrderedDict()
        lock = Lock()
        held = 0

        @wraps(function)
        def found(*args: P.args, **kwargs: P.kwargs) -> T:
            nonlocal held
            key = args, tuple(sorted(kwargs.items()))
            with lock:
                if key in results:
                    results.move_to_end(key)
                    return results[key][0]
            result = function(*args, **kwargs)
            size = _bytes(result)
            with lock:
                if key not in results and size <= megabytes * 1e6:
                    results[key], held = (result, size), held + size
                    while held > megabytes * 1e6:
                        held -= results.popitem(last=False)[1][1]
            return result

        return found

    return decorate


def _bytes(result: Any) -> int:
    """Size of an array, or of a tuple of them."""
    parts = result if isinstance(result, tuple) else (result,)
    return sum(np.asarray(part).nbytes for part in parts)
