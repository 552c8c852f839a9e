"""Names under which the chapters' tables refer to functions of a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from workbench import Run

Computed = TypeVar("Computed", bound=Callable[..., float])
VALUES: dict[str, Callable[..., float]] = {}
"""Functions of a run and of named arguments, which a table gives."""


def value(function: Computed) -> Computed:
    """Register a function under its own name. Raises ValueError if the name is taken."""
    if VALUES.setdefault(function.__name__, function) is not function:
        raise ValueError(f"two ways to compute a number are called {function.__name__}")
    return function


@value
def quotient(run: Run, above: str, below: str) -> float:
    """A metric divided by another metric of the run."""
    return float(run.metrics[above] / run.metrics[below])


@value
def difference(run: Run, more: str, less: str) -> float:
    """A metric minus another metric of the run."""
    return float(run.metrics[more] - run.metrics[less])


@value
def multiple(run: Run, metric: str, factor: float) -> float:
    """A metric times a factor."""
    return float(factor * run.metrics[metric])


@value
def later(run: Run, metric: str, by: float) -> float:
    """A metric plus a constant."""
    return float(run.metrics[metric] + by)
