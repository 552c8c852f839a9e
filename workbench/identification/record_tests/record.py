"""A record as its tests see it: samples, excitation, and prior knowledge."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, replace
from functools import wraps
from hashlib import blake2b
from typing import TypeVar

import numpy as np

from workbench._core.arrays import RealArray

T = TypeVar("T")


def once(function: Callable[[RecordData], T]) -> Callable[[RecordData], T]:
    """Compute a function of a record only once for each record: several tests need the result."""

    @wraps(function)
    def kept(record: RecordData) -> T:
        name = f"{function.__module__}.{function.__qualname__}"
        if name not in record.__dict__:
            record.__dict__[name] = function(record)
        found: T = record.__dict__[name]
        return found

    return kept


@dataclass(frozen=True, eq=False)
class RecordData:
    """Inputs u (N, nu), outputs y (N, ny) and excitation r (N, nr) of one or several experiments.

    Parameters
    ----------
    u, y
        Finite inputs; NaN in y is a missing sample.
    r
        External signal that drove a closed loop; None: not recorded.
    starts
        First sample of each experiment, rising from 0.
    sample_time
        Sampling time [s].
    inputs, outputs
        Names of the channels.
    direct
        Whether y may respond to u within the same sample. False: the plant, or its converters,
        delay by at least a sample, so that an immediate dependence of u on y comes from the
        controller.
    order
        Order of the model to be estimated; None: not known yet.
    times
        Time stamps (N,) [s] of the samples; None: there are none, or they are even.
    """

    u: RealArray
    y: RealArray
    r: RealArray | None
    starts: tuple[int, ...]
    sample_time: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    direct: bool = True
    order: int | None = None
    times: RealArray | None = None

    def key(self) -> Hashable:
        """Identifies the record: a hash of the samples and all other fields."""
        hashed = blake2b(digest_size=16)
        for signal in (self.u, self.y, self.r, self.times):
            known = None if signal is None else np.ascontiguousarray(signal)
            hashed.update(repr(None if known is None else (known.shape, known.dtype.str)).encode())
            if known is not None:
                hashed.update(known.data)
        settings = (self.starts, self.sample_time, self.inputs, self.outputs)
        return hashed.digest(), settings, self.direct, self.order

    def pieces(self) -> Iterator[slice]:
        """Samples of each experiment."""
        for first, end in zip(self.starts, (*self.starts[1:], len(self.u)), strict=True):
            yield slice(first, end)

    def replaced(self, u: RealArray, y: RealArray) -> RecordData:
        """The record with other samples of u and y."""
        return replace(self, u=u, y=y)
