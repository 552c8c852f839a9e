"""A record as its tests see it: samples, what drove the loop, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from workbench.arrays import RealArray


@dataclass(frozen=True, eq=False)
class Record:
    """Inputs u (N, nu), outputs y (N, ny) and excitation r (N, nr) of one or several experiments.

    Parameters
    ----------
    u, y
        Finite inputs; NaN in y is a missing sample.
    r
        What drove a closed loop from outside; None: not recorded.
    starts
        First sample of each experiment, rising from 0.
    sample_time
        Sampling time [s].
    inputs, outputs
        Names of the channels.
    direct
        Whether y may answer to u within the same sample. False: the plant, or its converters,
        delays by a sample at least, so that what of u answers to y at once is the controller's.
    order
        Order of the model that is asked of the record, None: not known yet.
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

    def pieces(self) -> Iterator[slice]:
        """Samples of each experiment."""
        for first, end in zip(self.starts, (*self.starts[1:], len(self.u)), strict=True):
            yield slice(first, end)
