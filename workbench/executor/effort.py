"""Effort of a second opinion: the usual amount in every certificate, more in `verify --deep`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

DEEPER = 10
"""Factor by which a deep second opinion makes more draws, samples or simulations."""

_factor: ContextVar[int] = ContextVar("factor", default=1)


def tries(usual: int) -> int:
    """Number of draws, frequencies or samples to try, given the usual number.

    Examples
    --------
    >>> from workbench.executor.effort import deeper, tries
    >>> with deeper():
    ...     more = tries(20)
    >>> tries(20), more
    (20, 200)
    """
    return usual * _factor.get()


@contextmanager
def deeper() -> Iterator[None]:
    """Inside, second opinions try `DEEPER` times as much."""
    token = _factor.set(DEEPER)
    try:
        yield
    finally:
        _factor.reset(token)
