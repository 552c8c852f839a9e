"""The delay that every plant of a set bears in a channel, by branch and bound over frequency too.

At a frequency omega delays up to T turn the channel by angles up to omega T: the factor is
((1 + j t) / (1 - j t))^2 with t = tan(omega T / 4), at most 1 where a full half turn is reached.
Frequencies are cut into bands so narrow that t hardly changes along them. In real coordinates a
phase stands for both signs, so that the delay is proven for a lead as well; a loop that bears less
lead than lag is given too small a margin, and its bounds stay apart.
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
from workbench.mu.boxes.partition import BoxPart, Partition, corner_signs, effects_in
from workbench.mu.boxes.recentred import RealParameters

FIRST_PARTS = 24
"""Parts of the box from which the frequencies are found at which some plant can be turned to -1."""
STEP = 0.25
"""Relative growth of the frequency along a band that is not cut again, in units of the wanted
distance of the bounds; t grows by at most pi / 2 times as much."""
NARROWED = 0.75
"""Share of its turns down to which a part shrinks with its bands and is looked at again uncut."""
DECISIONS = 6
"""Share of the parts that one delay may take is one over this."""
CROSSING_ROUNDING = 1e-5
"""Share by which the delay of a member, found from its crossings in doubles, may be off: about
eps^(1/3), by which rounding moves a triple one."""
EVERY_BAND = "parts exclude every frequency for every plant"
ITS_CROSSING = "one plant has a crossing there"
"""What the bounds rest on."""
WITHIN = 0.999
"""Share of the wanted distance of the bounds that a delay is set for."""


@dataclass(frozen=True, eq=False)
class DelayBounds:
    """Every plant bears delays up to ``lower`` [s]; that with ``values`` (p,) not ``upper``.

    ``upper`` is infinite, and ``values`` None, where no plant is known that a delay destabilises.
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
        level = highest / (1 + WITHIN * gap)
        if undecided <= search.upper:
            level = (lower + highest) / 2
        if search.decide(level, region):
            lower = level
        elif search.upper > level:
            undecided = level
    need_agreement(
        (1 - CROSSING_ROUNDING) * lower, search.upper, "the delay", EVERY_BAND, ITS_CROSSING
    )
    return DelayBounds(min(lower, search.upper), search.upper, search.values)


def bears_delay(
    given: RealParameters,
    delay_of: Callable[[RealArray], float],
    delay: float,
    gap: float,
    parts: int,
) -> bool:
    """Whether so many parts prove that every plant bears a delay [s]; else as `delay_bounds`."""
    search = _DelaySearch(given, delay_of, gap, parts)
    search.share = parts
    region = search.region()
    return not region or (math.isfinite(delay) and search.decide(delay, region))


class _DelaySearch:
    """The bounds so far, and how many parts may still be examined."""

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
            self._seen(values)

    @property
    def goes_on(self) -> bool:
        """Whether parts and time are left."""
        return self.left > 0 and not self.context.late

    def frequency(self, v: float) -> float:
        """Frequency [rad/s] of one of the bilinear plane."""
        return float(angular_frequency(v, self.given.system.period))

    def _seen(self, values: RealArray) -> None:
        """Lower the upper bound to the delay margin of a member."""
        unstable = self.given.unstable(np.append(values, 0.0)[None])[0]
        found = 0.0 if unstable else self.delay_of(values)
        if found < self.upper:
            self.upper, self.values = found, values.copy()

    def _part(self, t: float, bands: tuple[Band, ...]) -> BoxPart:
        low, high = -np.ones(self.count), np.ones(self.count)
        low[-1], high[-1] = 0.0, t
        return BoxPart(low, high, bands)

    def region(self) -> list[Band]:
        """Bands outside which no plant can be turned to -1, by any phase."""
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
        return _joined([band for part in open_ for band in part.bands])

    def decide(self, delay: float, region: list[Band]) -> bool:
        """Whether every plant is proven to bear a delay."""
        budget = self.share
        open_ = [part for band in region for part in self._turned(self._part(1.0, (band,)), delay)]
        while open_:
            part = open_.pop()
            budget -= 1
            left = self._examined(part)
            if left is None or not left[0].bands:
                continue
            self._seen(part.centre[:-1])
            pieces = self._cut(*left, delay)
            if self.upper <= delay or budget <= 0 or self.context.late or not pieces:
                return False
            open_ += pieces
        return True

    def _examined(self, part: BoxPart) -> tuple[BoxPart, RealArray] | None:
        """The part with the bands that stay open, and what matters in it."""
        self.left -= 1
        effects = np.zeros(self.count)
        about = self.given.recentred(part)
        if about is not None:
            bands, response = about.open_bands(part.bands)
            part, effects = replace(part, bands=bands), effects_in(response, self.given.structure)
        return part, effects

    def _turned(self, part: BoxPart, delay: float) -> list[BoxPart]:
        """A part for each of its bands, with the turns that a delay makes along that band."""
        found = []
        for band in part.bands:
            high = part.high.copy()
            high[-1] = min(high[-1], self._turn(band[1], delay))
            if high[-1] >= part.low[-1]:
                found.append(BoxPart(part.low, high, (band,)))
        return found

    def _turn(self, v: float, delay: float) -> float:
        """The largest t of delays up to one at a frequency of the bilinear plane."""
        angle = min(self.frequency(v) * delay, math.pi) if math.isfinite(v) else math.pi
        return math.tan(angle / 4)

    def _cut(self, part: BoxPart, effects: RealArray, delay: float) -> list[BoxPart]:
        """Pieces of an open part; none where it is too narrow to be cut.

        What matters most is cut: a parameter, or the band, by the share of the turns that its
        lower half does without.
        """
        found: list[BoxPart] = []
        for one in self._turned(part, delay):
            ((low, high),) = one.bands
            spared = one.high[-1] - max(one.low[-1], self._turn(low, delay))
            share = spared / max(2 * part.width[-1], 1e-300)
            narrow = low > 0 and high / low <= 1 + STEP * self.gap
            shrunk = 2 * one.width[-1] <= NARROWED * 2 * part.width[-1]
            if shrunk:
                found.append(one)
            elif not narrow and share * effects[-1] >= effects.max() / 2:
                middle = _within(low, high)
                halves = replace(one, bands=((low, middle), (middle, high)))
                found += self._turned(halves, delay)
            else:
                partition = Partition(one)
                partition.pop()
                if not partition.cut(one, effects):
                    return []
                while partition:
                    found.append(partition.pop())
        return found


def _within(low: float, high: float) -> float:
    """A frequency inside a band."""
    if math.isinf(high):
        return 2.0 * low if low > 0 else 1.0
    return math.sqrt(low) * math.sqrt(high) if low > 0 else high / 8.0


def _joined(bands: list[Band]) -> list[Band]:
    """Bands that touch, as one."""
    found: list[Band] = []
    for low, high in sorted(bands):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found
