"""The margin of robust stability by branch and bound, as close as asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from workbench.arrays import RealArray
from workbench.mu.boxes.partition import BoxPart, Partition, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters

BISECTIONS = 60
"""Halvings of the size at which a direction becomes unstable."""
WITHIN = 0.999
"""Share of the wanted gap that a level is set for, so that rounding does not exceed it."""
LARGEST = 1e6
"""A margin beyond this is looked for no further."""
SIZES = 121
"""Sizes at which the directions of the corners are tried first."""
COARSE = 1.5
"""Ratio of the bounds above which a level between them is decided first."""


@dataclass(frozen=True, eq=False)
class BoxMargin:
    """Stable for every perturbation up to ``lower``; ``values`` (p,) of size ``upper`` are not.

    ``values`` are None where no unstable member was found. ``parts`` is how many were examined.
    """

    lower: float
    upper: float
    values: RealArray | None
    parts: int


def box_margin(given: RealParameters, gap: float, parts: int) -> BoxMargin:
    """Bounds with upper / lower - 1 <= gap, or as close as the number of parts allows."""
    search = _Search(given, parts)
    while search.upper > (1 + gap) * search.lower and search.left > 0:
        if search.lower > LARGEST:
            break
        level = search.upper / (1 + WITHIN * gap)
        if search.lower > 0 and search.upper > COARSE * search.lower:
            level = math.sqrt(search.lower * search.upper)
        if not math.isfinite(level):
            level = 2.0 * (search.lower or 0.5)
        if not search.decide(level):
            break
    return BoxMargin(search.lower, search.upper, search.values, parts - search.left)


class _Search:
    """The bounds so far."""

    def __init__(self, given: RealParameters, budget: int) -> None:
        self.given, self.left = given, budget
        self.lower, self.upper = 0.0, math.inf
        self.values: RealArray | None = None
        self.count = len(given.places)
        self._started()

    def _started(self) -> None:
        """An upper bound from the directions of the corners, over all sizes."""
        signs = corner_signs(self.count)
        for size in np.geomspace(1 / LARGEST, LARGEST, SIZES):
            for values in (size * signs)[self.given.unstable(size * signs)]:
                self._shrunk(values)
            if self.upper < math.inf:
                return

    def decide(self, level: float) -> bool:
        """Raise the lower bound to a level, or lower the upper one to it; False if neither."""
        before = self.upper
        partition = Partition(np.full(self.count, level))
        while partition:
            part, effects = partition.pop(), np.zeros(self.count)
            self.left -= 1
            self._tried(part)
            if self.upper <= level:
                return True
            about = self.given.recentred(part, level)
            if about is not None and about.stable:
                bands, response = about.open_bands(part.bands)
                part = replace(part, bands=bands)
                effects = effects_in(response, self.given.structure)
            if part.bands and (self.left <= 0 or not partition.cut(part, effects)):
                return self.upper < before
        self.lower = level
        return True

    def _tried(self, part: BoxPart) -> None:
        """Look for unstable members at the centre and at the corners of a part."""
        tried = np.vstack([part.centre, part.centre + corner_signs(self.count) * part.width])
        tried = tried[np.abs(tried).max(axis=1) > 0]
        unstable = tried[self.given.unstable(tried)]
        for values in unstable[np.argsort(np.abs(unstable).max(axis=1))][:2]:
            self._shrunk(values)

    def _shrunk(self, values: RealArray) -> None:
        """The least multiple of unstable values that is unstable still."""
        size = float(np.abs(values).max())
        low, high = 0.0, min(1.0, self.upper / size)
        if not self.given.unstable(high * values[None])[0]:
            return
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            if self.given.unstable(middle * values[None])[0]:
                high = middle
            else:
                low = middle
        if high * size < self.upper:
            self.upper, self.values = high * size, high * values
