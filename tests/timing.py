"""Processor time of a call, in a process that does other things as well."""

import time
from collections.abc import Callable


def least_seconds(task: Callable[[], object], tries: int = 3) -> float:
    """Least processor time [s] of several calls: garbage collection only adds to it."""

    def seconds() -> float:
        begun = time.process_time()
        task()
        return time.process_time() - begun

    return min(seconds() for _ in range(tries))
