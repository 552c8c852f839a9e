"""Covering a band of frequencies by intervals on which multipliers prove a bound of mu.

Multipliers D and G that prove a bound beta at one frequency prove it on a whole interval around
this frequency (see `workbench.certify.interval`). Such intervals are removed from the band, worst
frequencies first, until nothing of the band is left; beta rises wherever a bound lies above it.
Where the bound is flat over frequency these intervals are short, and multipliers that change with
frequency are used instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from workbench._core.arrays import Array, BoolArray, RealArray
from workbench.certify.interval import (
    END_MARGIN,
    Multipliers,
    proven_in_balls,
    proven_in_doubles,
)
from workbench.certify.stable_system import StableSystem
from workbench.executor.clock import proof_tick
from workbench.systems.frequency_grid import starting_grid

LARGEST_LOG_CHANGE = 0.2
"""Largest change of the bound's logarithm between neighbouring frequencies of the grid. With half
of it the grid has twice as many frequencies; with double of it more peaks are found only while
intervals are proven, which is slower.
"""

MAXIMUM_TOLERANCE = 1e-3
"""A maximum is resolved when its neighbours differ from it by less than this share. With half or
double of it a maximum takes a refinement more or less; the proofs of intervals judge either.
"""

REFINED_SHARE = 1e-3
"""Only bounds above this share of the largest are refined. A maximum a thousand times below the
largest decides nothing, and the intervals cover it anyway. Half or double refines a few more or
fewer of them.
"""

SETTLING_STEPS = 3
"""Number of refinements in which unsettled gaps are split. Gaps that remain are treated when
intervals are proven. Each one halves a gap. With half of them more is left to the intervals; with
twice as many smooth responses are bounded more often than needed.
"""

MOST_GRID_POINTS = 3000
"""Refinement stops at this number of frequencies. It limits memory. Half or double moves work to
the proofs of intervals or away from them.
"""


@dataclass(frozen=True)
class FrequencyBounds:
    """Upper bounds over frequency with their multipliers.

    Unlike `FrequencyResponseData`, it has bounds of mu, with their multipliers.

    ``omega`` (F,) [rad/s], increasing, ``M`` (F, c, r), ``upper`` (F,), and ``D_left`` (F, c, c),
    ``D_right`` (F, r, r), ``G`` (F, r, c) as `upper_bound` has them. ``least`` (F,) marks the
    bounds that are the least the method can find, not merely low enough; None: all of them.
    """

    omega: RealArray
    M: Array
    upper: RealArray
    D_left: Array
    D_right: Array
    G: Array
    least: BoolArray | None = field(default=None, kw_only=True)

    @property
    def is_least(self) -> BoolArray:
        """Marks the bounds (F,) that are the least the method can find."""
        return np.ones(len(self.omega), bool) if self.least is None else self.least

    def within(self, low: float, high: float) -> FrequencyBounds:
        """The bounds at frequencies from `low` to `high` [rad/s]."""
        return self.at((self.omega >= low) & (self.omega <= high))

    def at(self, chosen: BoolArray) -> FrequencyBounds:
        """The bounds at chosen frequencies (F,)."""
        names = ("omega", "M", "upper", "D_left", "D_right", "G")
        parts = (getattr(self, name)[chosen] for name in names)
        return FrequencyBounds(*parts, least=self.is_least[chosen])

    def joined(self, other: FrequencyBounds) -> FrequencyBounds:
        """Both sets of bounds in order of frequency; at equal frequencies those of `self`."""
        omega, first = np.unique(np.concatenate([self.omega, other.omega]), return_index=True)
        names = ("M", "upper", "D_left", "D_right", "G")
        parts = (np.concatenate([getattr(self, n), getattr(other, n)])[first] for n in names)
        least = np.concatenate([self.is_least, other.is_least])[first]
        return FrequencyBounds(omega, *parts, least=least)


BoundsAt = Callable[[RealArray], FrequencyBounds]
"""A function that gives upper bounds at increasing frequencies [rad/s] (F,) by any method."""
Settled = Callable[[FrequencyBounds], BoolArray]
"""Tells for each pair of neighbouring frequencies (F - 1,) whether nothing is expected between them
that their bounds do not show.
"""
Holds = Callable[[Array, float, Multipliers], BoolArray]
"""Whether multipliers prove a bound at matrices (F, c, r), by any method."""


def refined_bounds(
    bounds_at: BoundsAt, poles: Array, settled: Settled | None = None
) -> FrequencyBounds:
    """Upper bounds on a grid chosen from the poles, refined at maxima and at steep slopes.

    If bounds need not be the least, slopes say nothing, and `settled` is used instead.
    """
    found, unsettled = bounds_at(starting_grid(poles)), None
    steps = SETTLING_STEPS
    while True:
        if settled is not None:
            unsettled = ~settled(found) & (steps > 0)
            steps -= 1
        new = _frequencies_to_add(found, unsettled)
        if not new.size or len(found.omega) >= MOST_GRID_POINTS:
            break
        found = found.joined(bounds_at(new))
    return found


def _frequencies_to_add(found: FrequencyBounds, unsettled: BoolArray | None) -> RealArray:
    """Frequencies to add: in unsettled gaps (F - 1,), or between neighbours that differ too much,
    and next to maxima.
    """
    omega, bound = found.omega, found.upper
    inner = slice(1 if omega[0] == 0.0 else 0, -1 if np.isinf(omega[-1]) else None)
    w, height = omega[inner], bound[inner]
    if len(w) < 2:
        return np.empty(0)
    floor = REFINED_SHARE * bound.max()
    logs = np.log(np.maximum(height, max(floor, np.finfo(float).tiny)))
    steps = np.abs(np.diff(logs))
    wanted = steps > LARGEST_LOG_CHANGE
    if unsettled is not None:
        wanted = unsettled[inner.start : len(unsettled) - (inner.stop is not None)]
    # The maximum may lie on either side of a point that is higher than its two neighbours.
    padded = np.concatenate([[-np.inf], logs, [-np.inf]])
    high = found.is_least[inner] & (height > 0.5 * bound.max())
    top = (logs >= padded[:-2]) & (logs >= padded[2:]) & high
    beside = (top[1:] | top[:-1]) & (steps > MAXIMUM_TOLERANCE)
    split = (wanted | beside) & (w[1:] > w[:-1] * (1 + 1e-9))
    middle: RealArray = np.sqrt(w[1:] * w[:-1])[split]
    return middle


def with_peak(found: FrequencyBounds, bounds_at: BoundsAt) -> FrequencyBounds:
    """The bounds, with further ones at the vertices of parabolas through the largest bound and its
    neighbours.

    A bound a little above the true peak is then proven at once, on the whole band.
    """
    for _ in range(PEAK_STEPS):
        k = int(np.argmax(found.upper))
        near = slice(max(k - 1, 0), k + 2)
        with np.errstate(all="ignore"):
            x, y = np.log(found.omega[near]), np.log(found.upper[near])
            slopes = np.diff(y) / np.diff(x)
            fall = -np.diff(slopes)
            vertex = (x[:-2] + x[1:-1] + slopes[:-1] * (x[2:] - x[:-2]) / fall) / 2
        if len(x) < 3 or not (np.isfinite(vertex).all() and (fall > 0).all()):
            break
        low, high = x[0] + (x[1] - x[0]) / 8, x[2] - (x[2] - x[1]) / 8
        if abs(vertex[0] - x[1]) < PEAK_SHARPNESS:
            break
        found = found.joined(bounds_at(np.exp(np.clip(vertex, low, high))))
    return found


PEAK_STEPS, PEAK_SHARPNESS = 12, 1e-7
"""Largest number of parabolas, and the change of log omega that ends them. They end earlier once
the peak moves by less. Half or double: a peak is known a little less or more exactly, and the proof
covers it either way.
"""

NEGLIGIBLE_BOUND = 1e-9
"""Bounds below this, absolute and as a share of the response, are not resolved further. It is well
above the rounding of doubles. With half or double of it, bounds of responses that are rounding take
a little longer or shorter.
"""

COARSENING_FACTOR, COARSENINGS = 10.0, 10
"""Factor by which the tolerance grows each time the allowed steps are used up, and how often. At
the end everything counts as met. Half or double changes how a hard bound is loosened, in more or
fewer steps.
"""

MOST_FAILURES_OF_BALLS = 5
"""Number of failures after which ball arithmetic, which is slow, is not tried any more. Half gives
up on gaps that balls might prove; double costs more time where rounding hides every proof.
"""

HOPELESS_RATIO = 1e3
"""The search stops when the bound has grown by this factor: rounding hides every proof then. A
bound 1000 times too large tells a user nothing. Half or double ends the search one step earlier or
later.
"""

FIXED_INTERVALS, FIXED_INTERVALS_OF_MANY_STATES = 15, 4
"""Number of steps with fixed multipliers before linear multipliers cover the remaining gaps; for
few and for many states. Linear multipliers take longer and prove wider intervals where the bound is
flat. Half or double changes the time, and which valid bound is found.
"""

MANY_STATES = 100
"""With this many states or more, multipliers of all known frequencies are tried first, since discs
cost the cube of the number of states. Half or double changes the time, and which valid bound is
found.
"""

NARROW_GAP_RATIO = 1 + 1e-7
"""Gaps whose ends have a smaller ratio than this are covered by fixed multipliers only. Half or
double of the distance from 1: narrower or wider gaps are covered without a search; each cover is
proven.
"""

SMALLEST_POSITIVE = float(np.finfo(float).tiny)
"""Smallest normal floating-point number; avoids division by a frequency of 0."""

WIDE_INTERVAL = 0.3
"""An interval with at least this ln(high / low) is not improved by other multipliers: eight of them
cover a decade. With half of it fewer intervals are tried again; with double of it more are.
"""

GAPS_AT_ONCE = 32
"""Number of gaps whose middles are bounded in one call, which costs less than one call for each.
Half or double changes the time; with more, middles may be bounded that an interval would have
closed.
"""

TRIALS, NEAR_TRIALS = 24, (-8, -4, -2, -1, 1, 2, 4, 8)
"""Multipliers tried for an interval: this many from all of its gap, and those at these distances,
in grid points, from the worst frequency. Trials cost far less than discs of many states. Half or
double changes the time, and which valid bound is found.
"""


@dataclass(frozen=True, eq=False)
class CertifiedInterval:
    """Frequencies low to high [rad/s] on which multipliers prove the bound of a peak.

    ``omega`` [rad/s] is a frequency within; ``D_left`` (c, c), ``D_right`` (r, r) and ``G`` (r, c)
    are the multipliers at it. ``slopes`` are their derivatives with respect to frequency [s], zero
    if None.
    """

    low: float
    high: float
    omega: float
    D_left: Array
    D_right: Array
    G: Array
    slopes: tuple[Array, Array, Array] | None = None

    def multipliers(self, omega: Any) -> tuple[Array, Array, Array]:
        """D_left, D_right and G at `omega` [rad/s] in the interval, a number or (F, 1, 1)."""
        fixed = self.D_left, self.D_right, self.G
        if self.slopes is None:
            return fixed
        moved = (one + (omega - self.omega) * d for one, d in zip(fixed, self.slopes, strict=True))
        return next(moved), next(moved), next(moved)


class BandCover:
    """The band of frequencies, the intervals that cover it at the current beta, and the open gaps.

    ``found`` are the bounds known so far, ``intervals`` the certified intervals and ``open`` the
    gaps (low, high) [rad/s] not yet covered. ``plain_at`` gives bounds with multipliers that change
    less over frequency, and which may be larger: G of real scalars grows as 1 / omega where their
    response falls as omega.
    """

    def __init__(
        self,
        system: StableSystem,
        bounds_at: BoundsAt,
        tolerance: float,
        found: FrequencyBounds,
        plain_at: BoundsAt | None = None,
        holds: Holds | None = None,
    ) -> None:
        if system.vanishes():  # the rest of it in doubles is rounding
            found = replace(found, M=0.0 * found.M, upper=0.0 * found.upper)
        self.system, self.bounds_at, self.plain_at = system, bounds_at, plain_at
        self.tolerance, self.found, self.holds = tolerance, found, holds
        size = float(np.abs(found.M).max())
        # it is no larger than the rounding of terms that cancel
        if not size and not system.vanishes():
            size = float(system.summands(found.omega).max())
        self.beta = max(
            (1 + tolerance) * float(found.upper.max()), NEGLIGIBLE_BOUND * min(size, 1.0)
        )
        self.intervals: list[CertifiedInterval] = []
        self.failures_of_balls = 0
        self.open = [(float(found.omega[0]), float(found.omega[-1]))]

    @property
    def proven(self) -> float:
        """The bound proven on the whole band; infinite as long as a gap is open."""
        return math.inf if self.open else self.beta

    def complete(self, steps: int, most: float = math.inf) -> str:
        """Cover the band and return a message about how it ended.

        After every `steps` steps the tolerance grows by `COARSENING_FACTOR`. The search ends early
        if no bound up to `most` can be proven any more.
        """
        if self.beta == 0.0:
            self.open = []
            return "the response is zero"
        asked, largest = self.tolerance, COARSENINGS * steps
        many = len(self.system.A) >= MANY_STATES
        fixed = FIXED_INTERVALS_OF_MANY_STATES if many else FIXED_INTERVALS
        hopeless, step = min(HOPELESS_RATIO * self.beta, most), 0
        for step in range(largest):
            if not self.open or self.beta > hopeless:
                break
            proof_tick("proof of a peak")
            if step and step % steps == 0:
                self.tolerance *= COARSENING_FACTOR
                self.beta *= 1 + self.tolerance
            wide = [
                gap
                for gap in self.open
                if NARROW_GAP_RATIO < gap[1] / max(gap[0], SMALLEST_POSITIVE) < math.inf
            ]
            if step < fixed or not wide:
                self._step()
            else:
                self._linear_step(wide[-1])
        if self.open:
            gaps = ", ".join(f"{low:.6g} to {high:.6g}" for low, high in self.open[:3])
            return (
                f"stopped after {step} steps; not covered: {gaps} rad/s; the "
                f"realisation's eigenvectors have condition {self.system.condition:.1g}; give it "
                "balanced or modal"
            )
        least = float(self.found.upper.max())
        message = f"{len(self.intervals)} intervals"
        if self.beta > (1 + 2 * asked) * least and self.beta > NEGLIGIBLE_BOUND:
            message += f"; {self.beta - least:.3g} above the largest bound at one frequency"
        return message

    def _step(self) -> None:
        """Cover an interval around the worst open frequency with fixed multipliers.

        If they prove nothing there, beta rises by the tolerance.
        """
        index = self._widest(self._worst())
        omega, bound = float(self.found.omega[index]), float(self.found.upper[index])
        if bound * (1 + 0.5 * self.tolerance) > self.beta:
            self.beta = bound * (1 + self.tolerance)
        multipliers = self._multipliers(index)
        ends, doubt = proven_in_doubles(self.system, multipliers, self.beta, omega)
        if ends is None and doubt:
            ends = self._in_balls(multipliers, omega)
        if ends is None or _log_width(*ends) < WIDE_INTERVAL:
            beside = self._finite_frequency(omega)
            plain = self._plain_interval(beside)
            if plain is not None and (ends is None or _log_width(*plain[0]) > _log_width(*ends)):
                omega, (ends, multipliers) = beside, plain
        if not self._close_interval(ends, omega, multipliers):
            self.beta *= 1 + self.tolerance

    def _widest(self, worst: int) -> int:
        """The frequency whose multipliers hold at the largest number of frequencies around it and
        the worst one.

        The search is made only for many states, with a margin for rounding in discs.
        """
        holds, level = self.holds, self.beta * (1 - 0.25 * self.tolerance)
        if holds is None or len(self.system.A) < MANY_STATES:
            return worst
        omega = self.found.omega
        (low, high) = next(gap for gap in self.open if gap[0] <= omega[worst] <= gap[1])
        inside = np.flatnonzero((omega >= low) & (omega <= high))
        own = int(np.searchsorted(inside, worst))
        tried = {own, *np.linspace(0, len(inside) - 1, TRIALS).astype(int).tolist()}
        tried |= {min(max(own + step, 0), len(inside) - 1) for step in NEAR_TRIALS}

        def reached(place: int) -> tuple[bool, int]:
            """Whether the multipliers at a place reach the worst frequency, and how many
            frequencies they reach.
            """
            held = holds(self.found.M[inside], level, self._multipliers(inside[place]))
            if not held[place]:
                return False, 0
            fails = np.flatnonzero(~held)
            first = int(fails[fails < place].max(initial=-1)) + 1
            last = int(fails[fails > place].min(initial=len(inside))) - 1
            return first <= own <= last, last - first

        return int(inside[max(sorted(tried), key=lambda place: (*reached(place), place == own))])

    def _finite_frequency(self, omega: float) -> float:
        """A finite positive frequency: for 0 and infinity, where scalings may grow without limit,
        one in its gap.
        """
        for low, high in self.open:
            if low == omega == 0.0 and high < math.inf:
                return high / 2
            if high == omega == math.inf and low > 0.0:
                return 2 * low
        return omega

    def _plain_interval(self, omega: float) -> tuple[tuple[float, float], Multipliers] | None:
        """The interval around a frequency that its plain multipliers prove; None: no interval."""
        if self.plain_at is None:
            return None
        found = self.plain_at(np.array([omega]))
        if found.upper[0] * (1 + 0.5 * self.tolerance) > self.beta:
            return None
        multipliers = found.D_left[0], found.D_right[0], found.G[0]
        ends, _ = proven_in_doubles(self.system, multipliers, self.beta, omega)
        return None if ends is None else (ends, multipliers)

    def _multipliers(self, index: int) -> Multipliers:
        """D_left, D_right and G of a known frequency."""
        return self.found.D_left[index], self.found.D_right[index], self.found.G[index]

    def _in_balls(self, multipliers: Multipliers, omega: float) -> tuple[float, float] | None:
        """Ends that ball arithmetic proves; None also if it has failed too often before."""
        if self.failures_of_balls >= MOST_FAILURES_OF_BALLS:
            return None
        ends = proven_in_balls(self.system, multipliers, self.beta, omega, END_MARGIN)
        self.failures_of_balls += ends is None
        return ends

    def _close_interval(
        self,
        ends: tuple[float, float] | None,
        omega: float,
        multipliers: Multipliers,
        slopes: tuple[Array, Array, Array] | None = None,
    ) -> bool:
        """Remove an interval from the open gaps; False if none of them is wide enough."""
        if ends is None or not _wide(*ends):
            return False
        D_left, D_right, G = multipliers
        self.intervals.append(CertifiedInterval(*ends, omega, D_left, D_right, G, slopes))
        self.open = [rest for one in self.open for rest in parts_left_open(one, ends)]
        return True

    def _linear_step(self, gap: tuple[float, float]) -> None:
        """Cover the middle of a gap with multipliers between those of its ends.

        If rounding hides what they prove, ball arithmetic tries the multipliers of the middle
        itself; if nothing is proven, the gap is halved.
        """
        low, high = gap
        self._index_of(low), self._index_of(high)
        # the second call may have moved the index of the first
        indices = [self._index_of(low), self._index_of(high)]
        for index in indices:
            bound = float(self.found.upper[index])
            if bound * (1 + 0.5 * self.tolerance) > self.beta:
                self.beta = bound * (1 + self.tolerance)
        first, second = (self._multipliers(index) for index in indices)
        # Multiples of multipliers prove the same bound: scale the second to be near the first.
        with np.errstate(all="ignore"):
            ratio = np.exp(np.mean(np.log(np.diag(first[1]).real / np.diag(second[1]).real)))
        pairs = list(zip(first, second, strict=True))
        middle = [(a + ratio * b) / 2 for a, b in pairs]
        change = [(ratio * b - a) / 2 for a, b in pairs]
        omega, half = (low + high) / 2, (high - low) / 2
        slopes = change[0] / half, change[1] / half, change[2] / half
        ends, doubt = proven_in_doubles(self.system, middle, self.beta, omega, slopes, half)
        if self._close_interval(ends, omega, middle, slopes):
            return
        if ends is None and doubt:
            index = self._index_of(omega)
            fixed = self._multipliers(index)
            if self._close_interval(self._in_balls(fixed, omega), omega, fixed):
                return
        plain = self._plain_interval(omega)
        if plain is not None and self._close_interval(plain[0], omega, plain[1]):
            return
        self.open.remove(gap)
        between = _middle(low, high) if low > 0 else omega
        self.open += [(low, between), (between, high)]

    def _index_of(self, omega: float) -> int:
        """Index of a frequency. A new frequency is bounded first; a bound that is not the least is
        computed again.
        """
        index = int(np.searchsorted(self.found.omega, omega))
        known = index < len(self.found.omega) and self.found.omega[index] == omega
        if known and self.found.is_least[index]:
            return index
        self.found = self.bounds_at(np.array([omega])).joined(self.found)
        return int(np.searchsorted(self.found.omega, omega))

    def _worst(self) -> int:
        """Index of the open frequency with the largest bound.

        If no known frequency is open, the middles of the widest gaps are bounded first.
        """
        omega = self.found.omega
        inside = np.zeros(len(omega), dtype=bool)
        for low, high in self.open:
            inside |= (omega >= low) & (omega <= high)
        if not inside.any():
            widest = sorted(self.open, key=_width)[-GAPS_AT_ONCE:]
            new = np.unique([_middle(*gap) for gap in widest])
            self.found = self.found.joined(self.bounds_at(new))
            return int(np.flatnonzero(self.found.omega == new[0])[0])
        index = int(np.argmax(np.where(inside, self.found.upper, -1.0)))
        return self._index_of(float(omega[index]))


def _wide(low: float, high: float) -> bool:
    """Whether an interval is wider than the rounding errors of its ends."""
    return high - low > 1e-11 * low if math.isfinite(high) else True


def parts_left_open(
    gap: tuple[float, float], ends: tuple[float, float]
) -> list[tuple[float, float]]:
    """The parts of a gap that an interval leaves open."""
    if ends[1] < gap[0] or ends[0] > gap[1]:
        return [gap]
    left = [(gap[0], ends[0])] if ends[0] > gap[0] else []
    return left + ([(ends[1], gap[1])] if ends[1] < gap[1] else [])


def _middle(low: float, high: float) -> float:
    """Geometric mean of two frequencies. 0 and infinity are on the grid and covered first."""
    return math.sqrt(low) * math.sqrt(high)


def _log_width(low: float, high: float) -> float:
    """Width of an interval on a logarithmic scale; finite also for an interval from 0 or to
    infinity.
    """
    return math.log(min(high, 1 / SMALLEST_POSITIVE)) - math.log(max(low, SMALLEST_POSITIVE))


def _width(gap: tuple[float, float]) -> float:
    """Width of a gap on a logarithmic scale."""
    return math.log(gap[1] / gap[0])
