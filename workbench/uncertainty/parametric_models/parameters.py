"""Uncertain physical parameters, and sets of their deltas at which models are evaluated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError

MAX_FACTORIAL_ROWS = 5_000_000
"""Largest number of rows of a full factorial."""


@dataclass(frozen=True)
class Parameter:
    """Uncertain parameter with the value nominal * (1 + tolerance * delta), |delta| <= 1 (eq.
    5.10).

    The name must be a Python identifier; the tolerance is relative.

    Source: E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).

    Examples
    --------
    >>> from workbench.uncertainty import Parameter
    >>> float(Parameter("k", nominal=4.0, tolerance=0.25).at(1.0))
    5.0
    """

    name: str
    nominal: float
    tolerance: float

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise InputError(
                f"a parameter is called {self.name!r}; it must be a name that an argument can have"
            )
        if not (np.isfinite(self.nominal) and self.nominal != 0.0):
            raise InputError(
                f"{self.name} has nominal {self.nominal}; a relative tolerance needs a finite "
                "nominal other than 0"
            )
        if not 0.0 < self.tolerance < np.inf:
            raise InputError(
                f"{self.name} has tolerance {self.tolerance}; it must be positive and finite; "
                "a certain parameter is a constant of the model"
            )

    def at(self, delta: ArrayLike) -> Any:
        """Values (...) of the parameter for `delta` (...)."""
        return self.nominal * (1.0 + self.tolerance * np.asarray(delta, dtype=float))


def vertex_deltas(parameters: Sequence[Parameter]) -> RealArray:
    """All combinations (2^P, P) of the deltas -1 and 1.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, vertex_deltas
    >>> vertex_deltas([Parameter("k", 4.0, 0.25), Parameter("d", 1.0, 0.1)]).tolist()
    [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
    """
    return level_deltas(parameters, 2)


def level_deltas(parameters: Sequence[Parameter], count: int) -> RealArray:
    """All combinations (count^P, P) of `count` equidistant deltas from -1 to 1.

    Raises InputError for fewer than 2 levels, or if the table would be too large.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, level_deltas
    >>> level_deltas([Parameter("k", 4.0, 0.25)], count=3).ravel().tolist()
    [-1.0, 0.0, 1.0]
    """
    if count < 2:
        raise InputError(f"{count} levels; at least 2 are needed, for -1 and 1")
    if count ** len(parameters) > MAX_FACTORIAL_ROWS:
        raise InputError(
            f"{count} levels of {len(parameters)} parameters are {count ** len(parameters)} rows, "
            f"more than {MAX_FACTORIAL_ROWS}; take fewer, or random ones with `samples`"
        )
    return np.array(list(product(np.linspace(-1.0, 1.0, count), repeat=len(parameters))))


def random_deltas(
    parameters: Sequence[Parameter], count: int, rng: np.random.Generator
) -> RealArray:
    """Random deltas (count, P), uniform in [-1, 1].

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Parameter, random_deltas
    >>> drawn = random_deltas([Parameter("k", 4.0, 0.25)], 100, np.random.default_rng(0))
    >>> drawn.shape, bool(abs(drawn).max() <= 1)
    ((100, 1), True)
    """
    return rng.uniform(-1.0, 1.0, (count, len(parameters)))
