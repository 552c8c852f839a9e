"""Cells of a box of parameters, and the proof of stability over one cell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray


@dataclass(frozen=True, eq=False)
class ParameterCell:
    """A part of a box of parameters from ``low`` to ``high`` (p,), halved ``depth`` times."""

    low: RealArray
    high: RealArray
    depth: int = 0

    @property
    def centre(self) -> RealArray:
        middle: RealArray = (self.low + self.high) / 2
        return middle

    @property
    def volume(self) -> float:
        """Product of the cell's edges, in the units of the parameters."""
        return float(np.prod(self.high - self.low))

    def halves(self, along: int) -> Iterator[ParameterCell]:
        """Both halves of the cell, cut along the parameter with this index."""
        for side, end in (("high", self.high.copy()), ("low", self.low.copy())):
            end[along] = self.centre[along]
            yield replace(self, **{side: end}, depth=self.depth + 1)


@dataclass(frozen=True, eq=False)
class CellProof:
    """Matrices P (2, n, n) of both modes, and the dwell time [samples] that they prove over a
    cell.
    """

    cell: ParameterCell
    P: RealArray
    dwell: int
