"""The box of real parameters cut into parts, and of each part the frequencies still open.

A part whose bands are all closed is proven: no perturbation in it puts a pole on the axis, so that
all of its members have as many poles right of it as its centre. Frequencies that a part closes are
closed for both of its pieces, so that each piece looks at what is left only. As parts shrink,
bounds of their recentred systems fall to 0, and so every set is decided whose members are all
stable.

Sources: R. de Gaston and M. Safonov, "Exact calculation of the multiloop stability margin", IEEE
TAC 33 (1988); M. Newlin and P. Young, "Mixed mu problems and branch and bound techniques", CDC
1992.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.mu.boxes.bands import WHOLE, Band
from workbench.structure import Real, Structure

NARROWEST_WIDTH = 1e-9
"""Half-width, relative to the whole box, below which a parameter is not cut again."""

MOST_CORNERS = 64
"""Corners of a part that are looked at; of one with more, those of its first parameters."""

CUT = 0.487
"""Share of a part that is cut off. Borders of stability often stand at values such as a half, and a
part that touches one is decided by no number of cuts."""

Weight = Callable[[RealArray, RealArray], float]
"""What a part from low to high, both (p,), counts."""


@dataclass(frozen=True, eq=False)
class BoxPart:
    """Normalised parameters from ``low`` to ``high``, both (p,), and its open bands."""

    low: RealArray
    high: RealArray
    bands: tuple[Band, ...] = WHOLE

    @property
    def centre(self) -> RealArray:
        """Middles (p,)."""
        return (self.low + self.high) / 2

    @property
    def width(self) -> RealArray:
        """Half-widths (p,)."""
        return (self.high - self.low) / 2

    @property
    def reach(self) -> RealArray:
        """Half-widths (p,) that overlap those of neighbours, so that rounding leaves no gap."""
        return self.width * (1 + 8 * EPS) + 8 * EPS * np.abs(self.centre)


class Partition:
    """The open parts of a box of parameters, those that count most first."""

    def __init__(self, whole: BoxPart, weight: Weight | None = None) -> None:
        self.whole = whole
        size = whole.high - whole.low
        self.weight = weight or (lambda low, high: float(np.prod((high - low) / size)))
        self._open: list[tuple[float, int, BoxPart]] = []
        self._count = 0
        self.put(whole)

    def __bool__(self) -> bool:
        return bool(self._open)

    def put(self, part: BoxPart) -> None:
        """Add an open part."""
        heapq.heappush(self._open, (-self.weight(part.low, part.high), self._count, part))
        self._count += 1

    def pop(self) -> BoxPart:
        """Take the open part that counts most."""
        return heapq.heappop(self._open)[2]

    def cut(self, part: BoxPart, effects: RealArray) -> bool:
        """Put both pieces of a part back, cut where it matters most; False if it is too narrow.

        ``effects`` (p,) tell how much each parameter matters; of equal ones the widest is cut.
        """
        share = part.width / self.whole.width
        effects = np.where(share > NARROWEST_WIDTH, effects + np.finfo(float).eps * share, -1.0)
        j = int(np.argmax(effects))
        if effects[j] < 0:
            return False
        border = part.low[j] + CUT * (part.high[j] - part.low[j])
        below, above = part.high.copy(), part.low.copy()
        below[j] = above[j] = border  # the very same number, so that the pieces leave nothing out
        self.put(BoxPart(part.low, below, part.bands))
        self.put(BoxPart(above, part.high, part.bands))
        return True


def effects_in(response: ComplexArray, structure: Structure) -> RealArray:
    """How much each real parameter of a part matters for a response (c, r), relative to the most.

    The response is that of the recentred system, whose inputs have the part's half-widths.
    """
    blocks = zip(structure, structure.row_slices, structure.column_slices, strict=True)
    found = np.array(
        [
            np.linalg.norm(response[:, into]) * np.linalg.norm(response[out])
            for block, into, out in blocks
            if isinstance(block, Real)
        ]
    )
    return found / (found.max() or 1.0)


def corner_signs(count: int) -> RealArray:
    """Signs of the corners of a box of so many parameters (k, p)."""
    free = min(count, int(np.log2(MOST_CORNERS)))
    signs = np.ones((2**free, count))
    signs[:, :free] = np.array(list(product((-1.0, 1.0), repeat=free)))
    return signs
