"""Modes of a switched system: their transitions over a sample, and how long they may last."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.input_checks import need_kind, need_numbers


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of a switched system.

    Parameters
    ----------
    name
        Name for messages and tables.
    A
        Transition matrix over one sample (n, n), or (V, n, n) for V plants. The plant stays the
        same while the modes change.
    shortest_samples
        Shortest stay [samples]; None if it is sought.
    longest_samples
        Longest stay [samples]; None for no limit.
    rate
        Factor by which V^(1/2) must fall in every sample. rate^(n - 1) A then replaces A^n, and the
        proof holds for the convex hull of the matrices A. None uses the powers of each A.

    Raises
    ------
    InputError
        A matrix is not square or not finite; stays are not positive whole numbers, or are in the
        wrong order; a mode whose shortest stay is sought has a longest stay; or the rate is not
        between 0 and 1, or belongs to a mode with a longest stay.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import Mode
    >>> mode = Mode("clean", 0.9 * np.eye(2), shortest_samples=None)
    >>> mode.name, mode.shortest_samples is None
    ('clean', True)
    """

    name: str
    A: RealArray
    _: KW_ONLY
    shortest_samples: int | None = 1
    longest_samples: int | None = None
    rate: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "A", transitions(self.name, self.A))
        check_stays(
            self.name,
            1 if self.shortest_samples is None else self.shortest_samples,
            self.longest_samples,
        )
        if self.shortest_samples is None and self.longest_samples is not None:
            raise InputError(
                f"mode {self.name!r}: its shortest stay is sought, so longest must be None, not "
                f"{self.longest_samples}"
            )
        if self.rate is not None:
            need_numbers(rate=self.rate)
        if self.rate is not None and not (0.0 < self.rate < 1.0 and self.longest_samples is None):
            raise InputError(
                f"mode {self.name!r}: rate is {self.rate!r}, longest {self.longest_samples}; a "
                "rate must "
                "lie between 0 and 1, and the mode must have no longest stay"
            )

    @property
    def decaying(self) -> RealArray:
        """A / rate (V, n, n), for which V must decrease; A where there is no rate."""
        return self.A / (self.rate or 1.0)

    def over(self, stay: int) -> RealArray:
        """The matrix (V, n, n) used for A^stay: the power, or rate^(stay - 1) A with a rate."""
        if self.rate is None:
            return np.linalg.matrix_power(self.A, stay)
        return self.rate ** (stay - 1) * self.A

    @cached_property
    def radius(self) -> RealArray:
        """Spectral radius of each plant (V,)."""
        radius: RealArray = np.abs(np.linalg.eigvals(self.A)).max(axis=1)
        return radius


def transitions(name: str, A: Any) -> RealArray:
    """A (V, n, n) of a mode; raises InputError for anything else."""
    try:
        array = np.asarray(A, dtype=float)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"mode {name!r}: A is no array of real numbers: {error}") from None
    array = array[None] if array.ndim == 2 else array
    if array.ndim != 3 or array.shape[1] != array.shape[2] or not array.size:
        raise InputError(
            f"mode {name!r}: A has shape {np.shape(A)}; it must be square, (n, n) or (V, n, n)"
        )
    if not np.isfinite(array).all():
        raise InputError(f"mode {name!r}: A has entries that are not finite")
    return array


def check_stays(name: str, shortest: int, longest: int | None) -> None:
    """Raise InputError unless the stays are whole, positive and in order."""
    for word, stay in (("shortest", shortest), ("longest", longest)):
        if stay is not None and not (is_whole(stay) and stay > 0):
            raise InputError(
                f"mode {name!r}: {word} is {stay!r}; it must be a positive number of samples"
            )
    if longest is not None and longest < shortest:
        raise InputError(f"mode {name!r}: longest is {longest}, less than shortest, {shortest}")


def check_modes(modes: Any) -> None:
    """Raise InputError unless there are at least two modes with the same plants and states."""
    if len(modes) < 2:
        raise InputError(f"{len(modes)} modes are given; switching needs two at least")
    for mode in modes:
        need_kind(mode, Mode, "each of modes")
    first = modes[0]
    for mode in modes[1:]:
        if mode.A.shape != first.A.shape:
            raise InputError(
                f"modes {first.name!r} and {mode.name!r} have A of shapes {first.A.shape} and "
                f"{mode.A.shape}; all must have the same plants and states, and also those "
                "that a mode does not use"
            )


def is_whole(value: Any) -> bool:
    """Whether a value is an integer."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
