"""The margin of robust stability by branch and bound, as close as asked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench.certify.agreement import need_agreement
from workbench.executor import Context
from workbench.mu.boxes.descent import corners_of_poles, drawn_corners, unstable_member
from workbench.mu.boxes.partition import BoxPart, Partition, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters
from workbench.systems.axis_poles import POLE_ROUNDINGS

BISECTIONS = 60
"""Number of bisections for the size at which a direction becomes unstable. They leave 1e-12 of a
range of 1e6; half of them would leave 1e-3, and a looser bound; more change nothing.
"""
GAP_SHARE = 0.999
"""A level lies this share of the wanted gap below the upper bound, so that rounding does not exceed
the gap. With half of the distance from 1 rounding still stays within it; double leaves 0.2 % of the
gap unused.
"""
LARGEST_MARGIN = 1e6
"""No margin beyond this size is searched for. Uncertainty a million times larger than stated is
beyond any plant. Half or double only changes what is called infinite.
"""
SMALLEST, SIZES, DECADE = 1e-12, 121, 10
"""The directions of the corners are first tried at sizes from SMALLEST, as a share of the largest
size: how many sizes, and how many of them per decade. It reaches from 1e-12 to 1. Half or double:
the first unstable member lies a little farther or nearer, and bisection follows.
"""
LEAST_SIZE = 1e-15
"""The search ends when the size in question falls below this. Rounding of poles is as large as the
effect of such sizes. Half or double changes nothing: the nominal loop is unstable up to rounding.
"""
DECISIONS = 4
"""A size is given at most about parts / DECISIONS parts; after that, the number is not raised any
more. With half of them a hard size takes half of all parts, and less is left for others; with
double of them sizes that need more parts stay undecided.
"""
TRIPLE_ROOT_ROUNDING = (POLE_ROUNDINGS * EPS) ** (1 / 3)
"""Relative error of the size of an unstable member that bisection in doubles has found, and of a
delay found from its crossings: rounding moves a triple pole or crossing by its cube root.
"""
REPROOF_PARTS = 4
"""A proof of a lower bound may use this many times the parts of the search that found it: on
another processor a few more parts may be needed. Poles near the axis round differently, and move
the cuts. With half of them a proof on another processor may end undecided; double takes longer to
refuse a wrong bound.
"""
PARTS_EXCLUDED = "parts of the box hold stable members only"
ONE_UNSTABLE = "one member of the box is unstable"
"""What the lower and the upper bound rest on."""
BISECTED_MEMBERS = 4
"""Number of a part's unstable members whose least unstable size is computed by bisection. The
member that is nearest by size is not always the first in its direction. With half of them the upper
bound falls more slowly; double costs time.
"""
FIRST_RATIO = 1e3
"""Ratio of two successive sizes while neither a stable size nor an unstable member is known. It
passes a range of 1e6 in two steps. Half or double takes a step more or less.
"""
CLOSED_SHARE = 0.75
"""Share of the distance between the bounds, on a logarithmic scale, that the next level would
close. A level near the upper bound is decided by more parts if it holds, and gains more. Half or
double of the distance from 1 changes the number of levels and the time.
"""
PARTS_GROWTH = 4
"""Factor by which the number of parts per size grows, from 1, whenever it did not suffice. All
earlier sizes together then cost a third of the last one. Half or double changes the time, not what
the limit on all parts allows.
"""
SHRINKS = (0.5, 0.2, 0.05, 0.01, 0.002)
"""Shares by which the upper bound is reduced, in turn, to look for a smaller unstable member. Large
steps come first, and the last is 0.2 %. Half or double changes where the upper bound stops falling,
by as much as the last.
"""


@dataclass(frozen=True, eq=False)
class BoxMargin:
    """Bounds of the margin: all perturbations up to ``lower`` keep stability, ``values`` (p,) of
    size ``upper`` do not.

    Unlike a `StabilityMargin`, it is the result of one search, without a certificate.

    ``values`` is None where no unstable member was found. ``parts`` is the number of parts
    examined.
    """

    lower: float
    upper: float
    values: RealArray | None
    parts: int


class Growing:
    """Boxes of p parameters about 0 that grow in all parameters at once."""

    def __init__(self, count: int) -> None:
        self.count = count

    def box(self, size: float) -> BoxPart:
        """The box with this size."""
        whole = np.full(self.count, size)
        return BoxPart(-whole, whole)

    def others(self, size: float) -> float:
        """Size of the blocks that are no real parameters, for a box of this size."""
        return size

    def size(self, values: RealArray) -> RealArray:
        """Size (k,) of the least box that contains each of the values (k, p)."""
        found: RealArray = np.abs(values).max(axis=1)
        return found

    def at(self, size: float, values: RealArray) -> RealArray:
        """Values (k, p) moved to the border of the box of this size."""
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
    largest: float = LARGEST_MARGIN,
    context: Context | None = None,
) -> BoxMargin:
    """Bounds with upper / lower - 1 <= gap, or as close as parts and time allow.

    No size above ``largest`` is examined; the upper bound is infinite if none up to it is unstable.
    Each round is recorded in ``context`` with the bounds so far, which hold whenever a time limit
    ends the search.
    """
    search = _Search(given, boxes, parts, largest, context or Context())
    search.scan()
    allowed, undecided = 1, math.inf  # parts allowed per size, and the least size that needs more
    while search.goes_on and search.upper > (1 + gap) * search.lower:
        highest, last = min(search.upper, undecided), allowed > parts // DECISIONS
        if highest < LEAST_SIZE:
            break
        if highest <= search.near(gap, last):
            if last:
                break
            undecided = math.inf
            continue
        level = search.level(gap, highest, first=math.isinf(undecided))
        if not search.decide(level, allowed):
            allowed, undecided = PARTS_GROWTH * allowed, level
        search.tell()
    upper = math.inf if search.values is None else search.upper
    need_agreement(
        (1 - TRIPLE_ROOT_ROUNDING) * search.lower, upper, "the margin", PARTS_EXCLUDED, ONE_UNSTABLE
    )
    return BoxMargin(search.lower, upper, search.values, parts - search.left)


def proven_stable(given: RealParameters, boxes: Growing, size: float, parts: int) -> bool:
    """Whether this many parts suffice to prove that the box of a size holds stable members only."""
    search = _Search(given, boxes, parts, math.inf, Context())
    return search.decide(size, parts) and search.lower == size


class _Search:
    """The search for the margin, with the bounds so far."""

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
        self._begun: dict[float, Partition] = {}  # the open parts of the boxes begun, by size

    @property
    def goes_on(self) -> bool:
        """Whether parts and time are left."""
        return self.left > 0 and not self.context.late

    def level(self, gap: float, highest: float, first: bool) -> float:
        """The size to decide next: one already begun, or a new one below ``highest``.

        At the start of a round (``first``), the least size already begun is continued.
        """
        begun = [size for size in self._begun if self.lower < size < self.upper]
        if first and begun:
            return min(begun)
        level = highest / (1 + GAP_SHARE * gap)
        if self.lower:
            return min(level, self.lower ** (1 - CLOSED_SHARE) * highest**CLOSED_SHARE)
        if first:
            return level
        return highest / (FIRST_RATIO if self.values is None else 2.0)

    def near(self, gap: float, last: bool) -> float:
        """A size so close above the lower bound that deciding smaller ones would gain little."""
        wide = 0.0 if last else self.lower**CLOSED_SHARE * self.upper ** (1 - CLOSED_SHARE)
        return max((1 + gap) * self.lower, wide)

    def _is_late(self) -> bool:
        return self.context.late

    def tell(self) -> None:
        """Record the bounds so far, and report progress."""
        examined = self.budget - self.left
        upper = math.inf if self.values is None else self.upper
        self.context.record({"parts": examined, "lower": self.lower, "upper": upper})
        self.context.progress("parts of the box", examined, self.budget)

    def scan(self) -> None:
        """Find a first upper bound: from corners at growing sizes, then by descent from the
        unstable member.
        """
        unit = self.boxes.box(1.0)
        poles = corners_of_poles(self.given, unit, np.zeros(self.boxes.count))
        corners = np.vstack([poles, drawn_corners(unit)])
        sizes = np.geomspace(self.upper * SMALLEST, self.upper, SIZES)
        for size in sizes:
            self._bisect_unstable(self.boxes.at(size, corners))
            if self.values is not None:
                break
        for size in sizes[::DECADE] if self.values is None else ():
            nominal = np.zeros(self.boxes.count)
            found = unstable_member(self.given, self.boxes.box(size), nominal, self._is_late)
            if found is not None:
                self._bisect(found[None])
                break
        self.tell()
        self.descend(corners)
        self.tell()

    def descend(self, corners: RealArray) -> None:
        """Lower the upper bound from its unstable member, and after that from the corners (k,
        p).
        """
        shrinks = list(SHRINKS)
        while self.values is not None and shrinks and not self.context.late:
            if not self._lower_from(shrinks[0], self.values):
                shrinks.pop(0)
        for corner in corners:
            if self.values is None or self.context.late:
                return
            while self._lower_from(SHRINKS[-2], self.boxes.at(self.upper, corner[None])[0]):
                pass

    def _lower_from(self, shrink: float, start: RealArray) -> bool:
        """Try to lower the upper bound by this share or more, starting from a member; False if none
        is found.
        """
        box = self.boxes.box((1 - shrink) * self.upper)
        found = unstable_member(self.given, box, start, self._is_late)
        if found is None or not self.boxes.size(found[None])[0] > 0:
            return False
        before = self.upper
        self._bisect(found[None])
        return self.upper < before

    def decide(self, size: float, parts: int) -> bool:
        """Decide a size: raise the lower bound to it, or lower the upper bound to it; False if
        undecided.
        """
        partition = self._begun.pop(size, None) or Partition(self.boxes.box(size))
        last = max(self.left - parts, 0)
        while partition:
            if self.left <= last or self.context.late:
                self._begun[size] = partition
                return False
            part, effects = partition.pop(), np.zeros(self.boxes.count)
            self.left -= 1
            corners = part.centre + corner_signs(self.boxes.count) * part.width
            self._bisect_unstable(np.vstack([part.centre, corners]))
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

    def _bisect_unstable(self, values: RealArray) -> None:
        """Lower the upper bound by bisection along the smallest few unstable values of those
        given.
        """
        sizes = self.boxes.size(values)
        values = values[(sizes > 0) & (sizes <= self.upper)]
        unstable = values[self.given.unstable(values)] if len(values) else values
        for one in unstable[np.argsort(self.boxes.size(unstable))][:BISECTED_MEMBERS]:
            self._bisect(one[None])

    def _bisect(self, values: RealArray) -> None:
        """Lower the upper bound by bisection along the direction of the values (1, p)."""
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
