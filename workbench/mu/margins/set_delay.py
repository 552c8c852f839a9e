"""The delay that every plant of a set tolerates, by branch and bound that cuts frequency too.

At a frequency omega, delays up to T turn the channel by angles up to omega T: the factor is ((1 + j
t) / (1 - j t))^2 with t = tan(omega T / 4), and t is limited to 1, which is a full half turn.
Frequencies are cut into bands so narrow that t hardly changes along them. In real coordinates a
phase stands for both signs, so that the delay is proven for a lead as well. If a loop tolerates
less lead than lag, its margin is therefore underestimated, and its bounds stay apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.agreement import need_agreement
from workbench.certify.stable_system import angular_frequency
from workbench.executor import Context
from workbench.mu.boxes.bands import WHOLE, Band
from workbench.mu.boxes.margin import GAP_SHARE, TRIPLE_ROOT_ROUNDING
from workbench.mu.boxes.partition import BoxPart, Partition, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters

FIRST_PARTS = 24
"""Number of parts of the box used to find the frequencies at which some plant can be turned to -1.
Each leaves narrower bands for all that follows. With half of them bands are wider; with twice as
many the start takes longer. The bounds hold either way.
"""
STEP = 0.25
"""A band is not cut again if the frequency grows along it by less than this, relative and in units
of the wanted distance of the bounds; t grows by at most pi / 2 times as much. Two such steps and
rounding leave less than the wanted distance. With half of it bands are cut once more; with double
of it bounds may stay apart.
"""
NARROWED_SHARE = 0.75
"""A part whose range of t shrinks along its bands to at most this share is examined again before it
is cut. A part examined again costs as much as one of two halves. Half or double of the distance
from 1 changes the time only.
"""
DECISIONS = 6
"""One delay may take the number of parts divided by this. Several delays are decided before the
bounds meet, and each needs its share. With half of them fewer delays are decided with more parts
each; with double of them hard ones stay undecided.
"""
EVERY_BAND = "parts exclude every frequency for every plant"
ITS_CROSSING = "one plant has a crossing there"
"""What the lower and the upper bound rest on."""


@dataclass(frozen=True, eq=False)
class DelayBounds:
    """Every plant tolerates delays up to ``lower`` [s], that at ``values`` (p,) not ``upper`` [s].

    ``upper`` is infinite and ``values`` None if no plant is known that a delay destabilises.
    """

    lower: float
    upper: float
    values: RealArray | None


def delay_bounds(
    given: RealParameters,
    delay_of: Callable[[RealArray], float],
    gap: float,
    parts: int,
    context: Context | None = None,
) -> DelayBounds:
    """Bounds of the delay with upper / lower - 1 <= gap, or as close as parts and time allow.

    Parameters
    ----------
    given
        The loop with the factor's t as its last real parameter.
    delay_of
        Delay margin [s] of the member with normalised values (p,) of the other parameters.
    """
    search = _DelaySearch(given, delay_of, gap, parts, context)
    lower = 0.0
    region = search.region()
    if not region:
        return DelayBounds(math.inf, math.inf, None)
    undecided = math.inf
    while search.goes_on:
        highest = min(search.upper, undecided)
        if not math.isfinite(highest):
            highest = 2 * math.pi / search.frequency(region[0][0])
        if highest <= (1 + gap) * lower:
            break
        level = highest / (1 + GAP_SHARE * gap)
        if undecided <= search.upper:
            level = (lower + highest) / 2
        if search.decide(level, region):
            lower = level
        elif search.upper > level:
            undecided = level
    need_agreement(
        (1 - TRIPLE_ROOT_ROUNDING) * lower, search.upper, "the delay", EVERY_BAND, ITS_CROSSING
    )
    return DelayBounds(min(lower, search.upper), search.upper, search.values)


def bears_delay(
    given: RealParameters,
    delay_of: Callable[[RealArray], float],
    delay: float,
    gap: float,
    parts: int,
) -> bool:
    """Whether this many parts prove that every plant tolerates a delay [s]; see `delay_bounds`."""
    search = _DelaySearch(given, delay_of, gap, parts)
    search.share = parts
    region = search.region()
    return not region or (math.isfinite(delay) and search.decide(delay, region))


class _DelaySearch:
    """The bounds so far, and the number of parts that may still be examined."""

    def __init__(
        self,
        given: RealParameters,
        delay_of: Callable[[RealArray], float],
        gap: float,
        parts: int,
        context: Context | None = None,
    ) -> None:
        self.given, self.delay_of, self.gap, self.left = given, delay_of, gap, parts
        self.context = context or Context()
        self.share = parts // DECISIONS + 1
        self.count = len(given.places)
        self.upper = math.inf
        self.values: RealArray | None = None
        for values in np.vstack([np.zeros(self.count - 1), corner_signs(self.count - 1)]):
            self._lower_to_member(values)

    @property
    def goes_on(self) -> bool:
        """Whether parts and time are left."""
        return self.left > 0 and not self.context.late

    def frequency(self, v: float) -> float:
        """Frequency [rad/s] that belongs to a frequency of the bilinear plane."""
        return float(angular_frequency(v, self.given.system.period))

    def _lower_to_member(self, values: RealArray) -> None:
        """Lower the upper bound to the delay margin of a member, if that is less."""
        unstable = self.given.unstable(np.append(values, 0.0)[None])[0]
        found = 0.0 if unstable else self.delay_of(values)
        if found < self.upper:
            self.upper, self.values = found, values.copy()

    def _part(self, t: float, bands: tuple[Band, ...]) -> BoxPart:
        low, high = -np.ones(self.count), np.ones(self.count)
        low[-1], high[-1] = 0.0, t
        return BoxPart(low, high, bands)

    def region(self) -> list[Band]:
        """Bands outside which no plant can be turned to -1 by any phase."""
        partition, open_ = Partition(self._part(1.0, WHOLE)), []
        for _ in range(FIRST_PARTS):
            if not partition:
                break
            part = partition.pop()
            left = self._examined(part)
            if left is not None and left[0].bands and not partition.cut(*left):
                open_.append(left[0])
        while partition:
            open_.append(partition.pop())
        return _joined_bands([band for part in open_ for band in part.bands])

    def decide(self, delay: float, region: list[Band]) -> bool:
        """Whether it is proven that every plant tolerates a delay."""
        budget = self.share
        open_ = [
            part for band in region for part in self._parts_by_band(self._part(1.0, (band,)), delay)
        ]
        while open_:
            part = open_.pop()
            budget -= 1
            left = self._examined(part)
            if left is None or not left[0].bands:
                continue
            self._lower_to_member(part.centre[:-1])
            pieces = self._cut(*left, delay)
            if self.upper <= delay or budget <= 0 or self.context.late or not pieces:
                return False
            open_ += pieces
        return True

    def _examined(self, part: BoxPart) -> tuple[BoxPart, RealArray] | None:
        """The part with the bands that stay open, and the effect of each parameter in it."""
        self.left -= 1
        effects = np.zeros(self.count)
        about = self.given.recentred(part)
        if about is not None:
            bands, response = about.open_bands(part.bands)
            part, effects = replace(part, bands=bands), effects_in(response, self.given.structure)
        return part, effects

    def _parts_by_band(self, part: BoxPart, delay: float) -> list[BoxPart]:
        """One part for each band, with the range of t that the delay needs along that band."""
        found = []
        for band in part.bands:
            high = part.high.copy()
            high[-1] = min(high[-1], self._turn(band[1], delay))
            if high[-1] >= part.low[-1]:
                found.append(BoxPart(part.low, high, (band,)))
        return found

    def _turn(self, v: float, delay: float) -> float:
        """The largest t for delays up to the given one, at a frequency of the bilinear plane."""
        angle = min(self.frequency(v) * delay, math.pi) if math.isfinite(v) else math.pi
        return math.tan(angle / 4)

    def _cut(self, part: BoxPart, effects: RealArray, delay: float) -> list[BoxPart]:
        """Pieces of an open part; an empty list if it is too narrow to be cut.

        The cut is made where it has the largest effect: in a parameter, or in frequency, whose
        effect counts by the share of the range of t that the lower half of the band does not need.
        """
        found: list[BoxPart] = []
        for one in self._parts_by_band(part, delay):
            ((low, high),) = one.bands
            spared = one.high[-1] - max(one.low[-1], self._turn(low, delay))
            share = spared / max(2 * part.width[-1], 1e-300)
            narrow = low > 0 and high / low <= 1 + STEP * self.gap
            shrunk = 2 * one.width[-1] <= NARROWED_SHARE * 2 * part.width[-1]
            if shrunk:
                found.append(one)
            elif not narrow and share * effects[-1] >= effects.max() / 2:
                middle = _inside_band(low, high)
                halves = replace(one, bands=((low, middle), (middle, high)))
                found += self._parts_by_band(halves, delay)
            else:
                partition = Partition(one)
                partition.pop()
                if not partition.cut(one, effects):
                    return []
                while partition:
                    found.append(partition.pop())
        return found


def _inside_band(low: float, high: float) -> float:
    """A frequency inside a band."""
    if math.isinf(high):
        return 2.0 * low if low > 0 else 1.0
    return math.sqrt(low) * math.sqrt(high) if low > 0 else high / 8.0


def _joined_bands(bands: list[Band]) -> list[Band]:
    """The bands, with those that touch joined into one."""
    found: list[Band] = []
    for low, high in sorted(bands):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found
