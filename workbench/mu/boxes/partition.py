"""A box of real parameters cut into parts, with the frequencies that are still open for each part.

A part whose bands are all closed is proven: no perturbation in it puts a pole on the axis, so that
all of its members have as many poles right of it as its centre. Frequencies that a part closes are
closed for both of its pieces, so that each piece examines only the remaining ones. As parts shrink,
bounds of their recentred systems fall to 0, so that every set with stable members only is decided
in the end.

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
"""A parameter is not cut again once its half-width is below this share of the whole box's. Below it
parameters move poles by their rounding. Half or double: one cut more or less of a part that stays
undecided.
"""

MOST_CORNERS = 64
"""Number of a part's corners that are examined; a part with more has only the first parameters
varied. That is six parameters. With half of them fewer unstable members are found in sets of more;
double takes twice as long for each part.
"""

CUT = 0.487
"""Share of a part's width at which it is cut. It is not a half, since borders of stability often
lie at round values, and a part that touches such a border would stay undecided after any number of
cuts. Nearer to a half, borders at round values are met again after more cuts; at half or double,
parts become uneven. Every cut is valid.
"""

Weight = Callable[[RealArray, RealArray], float]
"""Priority of the part from ``low`` to ``high``, both (p,)."""


@dataclass(frozen=True, eq=False)
class BoxPart:
    """Normalised parameters from ``low`` to ``high``, both (p,), and the bands of frequency still
    open.
    """

    low: RealArray
    high: RealArray
    bands: tuple[Band, ...] = WHOLE

    @property
    def centre(self) -> RealArray:
        """Centre (p,)."""
        return (self.low + self.high) / 2

    @property
    def width(self) -> RealArray:
        """Half-widths (p,)."""
        return (self.high - self.low) / 2

    @property
    def reach(self) -> RealArray:
        """Half-widths (p,), enlarged so that neighbours overlap and rounding leaves no gap between
        them.
        """
        return self.width * (1 + 8 * EPS) + 8 * EPS * np.abs(self.centre)


class Partition:
    """The open parts of a box of parameters, ordered by priority."""

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
        """Remove and return the open part of the highest priority."""
        return heapq.heappop(self._open)[2]

    def cut(self, part: BoxPart, effects: RealArray) -> bool:
        """Cut a part along one parameter and put both pieces back; False if the part is too narrow.

        ``effects`` (p,) tell how much each parameter matters, and the largest one is cut; among
        equal ones the widest.
        """
        share = part.width / self.whole.width
        effects = np.where(share > NARROWEST_WIDTH, effects + np.finfo(float).eps * share, -1.0)
        j = int(np.argmax(effects))
        if effects[j] < 0:
            return False
        border = part.low[j] + CUT * (part.high[j] - part.low[j])
        below, above = part.high.copy(), part.low.copy()
        # both pieces share the very same number, so that no gap is left between them
        below[j] = above[j] = border
        self.put(BoxPart(part.low, below, part.bands))
        self.put(BoxPart(above, part.high, part.bands))
        return True


def effects_in(response: ComplexArray, structure: Structure) -> RealArray:
    """How much each real parameter of a part affects a response (c, r), relative to the largest
    effect.

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
    """Signs (k, p) of the corners of a box with this many parameters."""
    free = min(count, int(np.log2(MOST_CORNERS)))
    signs = np.ones((2**free, count))
    signs[:, :free] = np.array(list(product((-1.0, 1.0), repeat=free)))
    return signs
