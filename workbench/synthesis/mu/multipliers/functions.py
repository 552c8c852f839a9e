"""Multipliers of an iteration: stable, minimum-phase functions with few parameters.

A complex block has a function d as D. A channel of a real scalar has two functions m_+ and m_- of a
multiplier m = m_+ m_-~ = D^2 (1 + jF) with |arg m| < pi/2 (F as in `scaled_bound`), so that |m| and
arg m are independent. All these are biquad functions. The n channels of a repeated scalar are
scaled by gains to similar sizes, and then mixed by a stable T with a stable inverse (see
`triangles`). So D is diag(d) T diag(gains).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.structure import Full, Structure
from workbench.structure import Real as RealScalar
from workbench.synthesis.mu.biquads import Biquads


class Place(NamedTuple):
    """Position of a block: the size of its D, and the indices of its channels, entries of T,
    outputs and inputs.
    """

    n: int
    channels: slice
    entries: slice
    row: slice
    column: slice


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of a structure as functions with a number of biquads; parameters are (rows, P).

    The first rows are d or m_+ of every channel (a full block has one channel). Then come the rows
    m_- of the real channels, with the same gain as m_+, and then the entries of every T. A loop may
    have more channels than the structure; there D is 1.
    """

    structure: Structure
    biquads: int

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Position of each block."""
        return tuple(self._places())

    @cached_property
    def channels(self) -> int:
        """Number of channels."""
        return sum(place.n for place in self.places)

    @cached_property
    def real(self) -> Array:
        """Index of each real channel, and its indices among inputs and outputs, shape (3, k)."""
        found = [
            (place.channels.start + i, place.column.start + i, place.row.start + i)
            for block, place in zip(self.structure, self.places, strict=True)
            if isinstance(block, RealScalar)
            for i in range(place.n)
        ]
        return np.array(found, dtype=int).reshape(-1, 3).T

    @property
    def minus(self) -> slice:
        """The rows of parameters that belong to m_-."""
        return slice(self.channels, self.channels + self.real.shape[1])

    @cached_property
    def functions(self) -> Biquads:
        """The functions of the rows of d, m_+ and m_-."""
        return Biquads(self.channels + self.real.shape[1], self.biquads)

    @property
    def rows(self) -> int:
        """Number of rows of parameters."""
        return self.functions.rows + sum(place.n * (place.n - 1) for place in self.places)

    def carried(self, other: Multipliers, x: RealArray, middle: float) -> RealArray:
        """Parameters of these multipliers with the same effect as parameters of `other` ones.

        The `other` multipliers belong to the same blocks and have no more biquads. New corners lie
        at the log frequency ``middle`` and have no effect at first.
        """
        known = other.functions.rows
        x = np.hstack([x, np.zeros((len(x), 4 * (self.biquads - other.biquads)))])
        x[:known, other.functions.size :: 2] = middle
        x[known:, other.functions.size :: 4] = middle
        if self.real.shape[1] == other.real.shape[1]:
            return x
        minus = x[self.real[0]]
        minus[:, 0] = 0.0
        return np.insert(x, self.channels, minus, axis=0)

    def _places(self) -> Iterator[Place]:
        """Position of each block, one after the other."""
        first = second = 0
        s = self.structure
        for block, row, column in zip(s, s.column_slices, s.row_slices, strict=True):
            n = 1 if isinstance(block, Full) else block.rows
            entries = slice(second, second + n * (n - 1))
            yield Place(n, slice(first, first + n), entries, row, column)
            first, second = first + n, entries.stop
