"""How progress is reported to the caller."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

Progress = Callable[[str, int, int], None]
"""Called with a description of the work, how much of it is done, and how much there is."""
Row = Mapping[str, float | int | str]
"""One round of an iteration, by column."""
Watch = Callable[[Sequence[Row]], None]
"""Called after every round of an iteration with the rows of all its rounds."""


def no_progress(description: str, done: int, total: int) -> None:
    """Progress that is not shown.

    Examples
    --------
    >>> from workbench.executor import InProcess, no_progress, spread
    >>> spread(abs, [-1, 2], InProcess(), progress=no_progress)
    [1, 2]
    """


def no_watch(rows: Sequence[Row]) -> None:
    """Rounds that are not shown.

    Examples
    --------
    >>> from workbench.executor import Context, no_watch
    >>> Context(watch=no_watch).record({"round": 1, "peak": 0.9})
    """


def row_entry(value: float | int | str) -> str:
    """An entry of a row as text.

    Examples
    --------
    >>> from workbench.executor import row_entry
    >>> row_entry(0.123456789), row_entry(12), row_entry("settled")
    ('0.1235', '12', 'settled')
    """
    if not isinstance(value, float):
        return str(value)
    return "-" if math.isnan(value) else f"{value:.4g}"
