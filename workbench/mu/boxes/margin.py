"""The margin of robust stability by branch and bound, as close as asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.agreement import need_agreement
from workbench.executor import Context
from workbench.mu.boxes.descent import corners_of_poles, drawn_corners, unstable_member
from workbench.mu.boxes.partition import BoxPart, Partition, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters

BISECTIONS = 60
"""Halvings of the size at which a direction becomes unstable."""
WITHIN = 0.999
"""Share of the wanted gap that a level is set for, so that rounding does not exceed it."""
LARGEST = 1e6
"""A margin beyond this is looked for no further."""
SMALLEST, SIZES, DECADE = 1e-12, 121, 10
"""Least size, as a share of the largest, at which the directions of the corners are tried first,
how many sizes, and how many of them a decade has."""
NOTHING = 1e-15
"""A size below which nothing is looked for."""
DECISIONS = 4
"""Share of the parts at which a size is allowed no more is one over this."""
SIZE_ROUNDING = 1e-5
"""Share by which the size of an unstable member, found by bisection in doubles, may be off: about
eps^(1/3), by which rounding moves a triple pole."""
PARTS_EXCLUDED = "parts of the box hold stable members only"
ONE_UNSTABLE = "one member of the box is unstable"
"""What the bounds rest on."""
TRIED = 4
"""Unstable members of a part whose least sizes are looked for."""
FALL = 1e3
"""Factor from one size to the next while nothing is known of stability or of instability."""
CLOSED = 0.75
"""Share of the bounds' distance, logarithmic, that the next level closes."""
MORE = 4
"""Factor by which the parts that a size may take grow, from 1, when they did not suffice."""
SHRINKS = (0.5, 0.2, 0.05, 0.01, 0.002)
"""Shares by which the size of an unstable member is made less, in turn, to look for another."""


@dataclass(frozen=True, eq=False)
class BoxMargin:
    """Stable for every perturbation up to ``lower``; ``values`` (p,) of size ``upper`` are not.

    ``values`` are None where no unstable member was found. ``parts`` is how many were examined.
    """

    lower: float
    upper: float
    values: RealArray | None
    parts: int


class Growing:
    """Boxes of p parameters that grow with their size: all of them about 0."""

    def __init__(self, count: int) -> None:
        self.count = count

    def box(self, size: float) -> BoxPart:
        """The box of a size."""
        whole = np.full(self.count, size)
        return BoxPart(-whole, whole)

    def others(self, size: float) -> float:
        """The size of what is no real parameter."""
        return size

    def size(self, values: RealArray) -> RealArray:
        """Size of the least box with the values (k, p)."""
        found: RealArray = np.abs(values).max(axis=1)
        return found

    def at(self, size: float, values: RealArray) -> RealArray:
        """Values (k, p) moved to the border of the box of a size."""
        return values * (size / self.size(values)[:, None])


class LastGrowing(Growing):
    """Boxes in which the last parameter grows from 0 and the others have size 1."""

    def box(self, size: float) -> BoxPart:
        low, high = -np.ones(self.count), np.ones(self.count)
        low[-1], high[-1] = 0.0, size
        return BoxPart(low, high)

    def others(self, size: float) -> float:
        return 1.0

    def size(self, values: RealArray) -> RealArray:
        return values[:, -1]

    def at(self, size: float, values: RealArray) -> RealArray:
        moved = values.copy()
        moved[:, -1] = size
        return moved


def box_margin(
    given: RealParameters,
    boxes: Growing,
    gap: float,
    parts: int,
    largest: float = LARGEST,
    context: Context | None = None,
) -> BoxMargin:
    """Bounds with upper / lower - 1 <= gap, or as close as parts and time allow.

    No size above ``largest`` is looked at; the upper bound is infinite where that is reached. Each
    round of the ``context`` has the bounds so far, which hold whenever its time limit ends them.
    """
    search = _Search(given, boxes, parts, largest, context or Context())
    search.scan()
    allowed, undecided = 1, math.inf  # parts for a size, and the least size that needs more
    while search.goes_on and search.upper > (1 + gap) * search.lower:
        highest, last = min(search.upper, undecided), allowed > parts // DECISIONS
        if highest < NOTHING:
            break
        if highest <= search.near(gap, last):
            if last:
                break
            undecided = math.inf
            continue
        level = search.level(gap, highest, first=math.isinf(undecided))
        if not search.decide(level, allowed):
            allowed, undecided = MORE * allowed, level
        search.tell()
    upper = math.inf if search.values is None else search.upper
    need_agreement(
        (1 - SIZE_ROUNDING) * search.lower, upper, "the margin", PARTS_EXCLUDED, ONE_UNSTABLE
    )
    return BoxMargin(search.lower, upper, search.values, parts - search.left)


def proven_stable(given: RealParameters, boxes: Growing, size: float, parts: int) -> bool:
    """Whether so many parts prove that the box of a size holds stable members only."""
    search = _Search(given, boxes, parts, math.inf, Context())
    return search.decide(size, parts) and search.lower == size


class _Search:
    """The bounds so far."""

    def __init__(
        self,
        given: RealParameters,
        boxes: Growing,
        budget: int,
        largest: float,
        context: Context,
    ) -> None:
        self.given, self.boxes, self.left, self.budget = given, boxes, budget, budget
        self.lower, self.upper = 0.0, largest
        self.values: RealArray | None = None
        self.context = context
        self._begun: dict[float, Partition] = {}  # what is left of the boxes of sizes

    @property
    def goes_on(self) -> bool:
        """Whether parts and time are left."""
        return self.left > 0 and not self.context.late

    def level(self, gap: float, highest: float, first: bool) -> float:
        """The size to decide next: one begun before, or one below the least that needs more parts.

        The first of a round is one that is begun, whose parts are gone on with.
        """
        begun = [size for size in self._begun if self.lower < size < self.upper]
        if first and begun:
            return min(begun)
        level = highest / (1 + WITHIN * gap)
        if self.lower:
            return min(level, self.lower ** (1 - CLOSED) * highest**CLOSED)
        if first:
            return level
        return highest / (FALL if self.values is None else 2.0)

    def near(self, gap: float, last: bool) -> float:
        """A size so close above the lower bound that those below it tell little."""
        wide = 0.0 if last else self.lower**CLOSED * self.upper ** (1 - CLOSED)
        return max((1 + gap) * self.lower, wide)

    def _is_late(self) -> bool:
        return self.context.late

    def tell(self) -> None:
        """Tell whoever watches of the bounds."""
        examined = self.budget - self.left
        upper = math.inf if self.values is None else self.upper
        self.context.record({"parts": examined, "lower": self.lower, "upper": upper})
        self.context.progress("parts of the box", examined, self.budget)

    def scan(self) -> None:
        """Bound the margin from above by corners, and by descent from there."""
        unit = self.boxes.box(1.0)
        poles = corners_of_poles(self.given, unit, np.zeros(self.boxes.count))
        corners = np.vstack([poles, drawn_corners(unit)])
        sizes = np.geomspace(self.upper * SMALLEST, self.upper, SIZES)
        for size in sizes:
            self._shrunk(self.boxes.at(size, corners))
            if self.values is not None:
                break
        for size in sizes[::DECADE] if self.values is None else ():
            nominal = np.zeros(self.boxes.count)
            found = unstable_member(self.given, self.boxes.box(size), nominal, self._is_late)
            if found is not None:
                self._bisected(found[None])
                break
        self.tell()
        self.descend(corners)
        self.tell()

    def descend(self, corners: RealArray) -> None:
        """Lower the upper bound from its member, and where that ends from the corners (k, p)."""
        shrinks = list(SHRINKS)
        while self.values is not None and shrinks and not self.context.late:
            if not self._found_below(shrinks[0], self.values):
                shrinks.pop(0)
        for corner in corners:
            if self.values is None or self.context.late:
                return
            while self._found_below(SHRINKS[-2], self.boxes.at(self.upper, corner[None])[0]):
                pass

    def _found_below(self, shrink: float, start: RealArray) -> bool:
        """Lower the upper bound by a share or more, from a member; False if none is found."""
        box = self.boxes.box((1 - shrink) * self.upper)
        found = unstable_member(self.given, box, start, self._is_late)
        if found is None or not self.boxes.size(found[None])[0] > 0:
            return False
        before = self.upper
        self._bisected(found[None])
        return self.upper < before

    def decide(self, size: float, parts: int) -> bool:
        """Raise the lower bound to a size, or lower the upper one to it; False if neither."""
        partition = self._begun.pop(size, None) or Partition(self.boxes.box(size))
        last = max(self.left - parts, 0)
        while partition:
            if self.left <= last or self.context.late:
                self._begun[size] = partition
                return False
            part, effects = partition.pop(), np.zeros(self.boxes.count)
            self.left -= 1
            corners = part.centre + corner_signs(self.boxes.count) * part.width
            self._shrunk(np.vstack([part.centre, corners]))
            if self.upper <= size:
                return True
            about = self.given.recentred(part, self.boxes.others(size))
            if about is not None and about.stable:
                bands, response = about.open_bands(part.bands, self._is_late)
                part = replace(part, bands=bands)
                effects = effects_in(response, self.given.structure)
            if part.bands and not partition.cut(part, effects):
                return False
        self.lower = size
        return True

    def _shrunk(self, values: RealArray) -> None:
        """Lower the upper bound to the least sizes at which the first of values are unstable."""
        sizes = self.boxes.size(values)
        values = values[(sizes > 0) & (sizes <= self.upper)]
        unstable = values[self.given.unstable(values)] if len(values) else values
        for one in unstable[np.argsort(self.boxes.size(unstable))][:TRIED]:
            self._bisected(one[None])

    def _bisected(self, values: RealArray) -> None:
        """Lower the upper bound to the least size at which values (1, p) are unstable."""
        low, high = 0.0, min(self.upper, float(self.boxes.size(values)[0]))
        if not self.given.unstable(self.boxes.at(high, values))[0]:
            return
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            if self.given.unstable(self.boxes.at(middle, values))[0]:
                high = middle
            else:
                low = middle
        if high < self.upper or self.values is None:
            self.upper, self.values = high, self.boxes.at(high, values)[0]
