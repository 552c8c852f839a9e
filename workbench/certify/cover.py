"""A band of frequencies covered by intervals on which multipliers prove a bound.

For a bound beta, multipliers D and G of one frequency prove it on a whole interval around (see
`interval`). Intervals are removed from the band, worst frequencies first, and beta rises where a
bound lies above it, until nothing is left. Where the bound is flat such intervals are short, and
multipliers that change over frequency take over (see `linear_interval`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array, RealArray
from workbench.certify.interval import StableSystem, certified_interval
from workbench.certify.linear_interval import certified_between
from workbench.systems.frequency_grid import starting_grid

LOG_STEP = 0.2
"""Change of the bound's logarithm between neighbours that asks for one more between them."""

FLAT = 1e-3
"""A maximum is resolved where its neighbours are within this, relative."""

LOW = 1e-3
"""Bounds below this share of the largest are not refined."""

MOST = 3000
"""Points at which refinement stops."""


@dataclass(frozen=True)
class FrequencyBounds:
    """Upper bounds over frequency with their multipliers.

    ``omega`` (F,) [rad/s], increasing, ``M`` (F, c, r), ``upper`` (F,), and ``D_left``
    (F, c, c), ``D_right`` (F, r, r), ``G`` (F, r, c) as `upper_bound` has them.
    """

    omega: RealArray
    M: Array
    upper: RealArray
    D_left: Array
    D_right: Array
    G: Array

    def within(self, low: float, high: float) -> FrequencyBounds:
        """At the frequencies [rad/s] from one to another."""
        inside = (self.omega >= low) & (self.omega <= high)
        names = ("omega", "M", "upper", "D_left", "D_right", "G")
        return FrequencyBounds(*(getattr(self, name)[inside] for name in names))

    def joined(self, other: FrequencyBounds) -> FrequencyBounds:
        """Both together, in the order of frequencies; of equal ones the first."""
        omega, first = np.unique(np.concatenate([self.omega, other.omega]), return_index=True)
        names = ("M", "upper", "D_left", "D_right", "G")
        parts = (np.concatenate([getattr(self, n), getattr(other, n)])[first] for n in names)
        return FrequencyBounds(omega, *parts)


BoundsAt = Callable[[RealArray], FrequencyBounds]
"""Upper bounds at increasing frequencies [rad/s] (F,), by whatever method."""


def refined(bounds_at: BoundsAt, poles: Array) -> FrequencyBounds:
    """Upper bounds on the grid of the poles, refined where the bound is steep or has a maximum."""
    found = bounds_at(starting_grid(poles))
    while len(found.omega) < MOST:
        new = _wanted(found.omega, found.upper)
        if not new.size:
            break
        found = found.joined(bounds_at(new))
    return found


def _wanted(omega: RealArray, bound: RealArray) -> RealArray:
    """Frequencies halfway between neighbours that are too different, or beside a maximum."""
    inner = slice(1 if omega[0] == 0.0 else 0, -1 if np.isinf(omega[-1]) else None)
    w, height = omega[inner], bound[inner]
    if len(w) < 2:
        return np.empty(0)
    floor = LOW * bound.max()
    logs = np.log(np.maximum(height, max(floor, np.finfo(float).tiny)))
    steps = np.abs(np.diff(logs))
    wanted = steps > LOG_STEP
    # A maximum lies on either side of the highest of three.
    padded = np.concatenate([[-np.inf], logs, [-np.inf]])
    top = (logs >= padded[:-2]) & (logs >= padded[2:]) & (height > 0.5 * bound.max())
    beside = (top[1:] | top[:-1]) & (steps > FLAT)
    split = (wanted | beside) & (w[1:] > w[:-1] * (1 + 1e-9))
    middle: RealArray = np.sqrt(w[1:] * w[:-1])[split]
    return middle


NOTHING = 1e-9
"""A bound below this, and below this share of the response, is not resolved further."""

COARSER, ROUNDS = 10.0, 10
"""Factor on the tolerance each time the steps allowed are used up, and how often that may be."""

FIXED = 15
"""Intervals of fixed multipliers, before what is left is covered by linear ones."""

NARROW = 1 + 1e-7
"""A gap with ends in a smaller ratio is left to fixed multipliers."""

TINY = float(np.finfo(float).tiny)

TOGETHER = 32
"""Gaps whose middles are bounded at once."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Frequencies low to high [rad/s] on which multipliers prove the peak's bound.

    ``omega`` [rad/s] is one between; ``D_left`` (c, c), ``D_right`` (r, r) and ``G`` (r, c) are the
    multipliers there. ``slopes`` are their derivatives by frequency [s], zero if None.
    """

    low: float
    high: float
    omega: float
    D_left: Array
    D_right: Array
    G: Array
    slopes: tuple[Array, Array, Array] | None = None

    def multipliers(self, omega: Any) -> tuple[Array, Array, Array]:
        """D_left, D_right and G at frequencies [rad/s] of the interval, a number or (F, 1, 1)."""
        fixed = self.D_left, self.D_right, self.G
        if self.slopes is None:
            return fixed
        moved = (one + (omega - self.omega) * d for one, d in zip(fixed, self.slopes, strict=True))
        return next(moved), next(moved), next(moved)


class Cover:
    """The band of the bounds found, and what of it is covered at the present beta."""

    def __init__(
        self, system: StableSystem, bounds_at: BoundsAt, tolerance: float, found: FrequencyBounds
    ) -> None:
        self.system, self.bounds_at = system, bounds_at
        self.tolerance, self.found = tolerance, found
        size = float(np.abs(found.M).max())
        self.beta = max((1 + tolerance) * float(found.upper.max()), NOTHING * min(size, 1.0))
        self.intervals: list[Interval] = []
        self.open = [(float(found.omega[0]), float(found.omega[-1]))]

    @property
    def proven(self) -> float:
        return math.inf if self.open else self.beta

    def complete(self, steps: int) -> str:
        """Cover the band; what is to be said of it."""
        if self.beta == 0.0:  # a rational function that is zero at so many points is zero
            self.open = []
            return "the response is zero"
        asked, largest = self.tolerance, ROUNDS * steps
        for step in range(largest):
            if not self.open:
                break
            if step and step % steps == 0:
                self.tolerance *= COARSER
                self.beta *= 1 + self.tolerance
            wide = [gap for gap in self.open if NARROW < gap[1] / max(gap[0], TINY) < math.inf]
            if step < FIXED or not wide:
                self._step()
            else:
                self._linear_step(wide[-1])
        if self.open:
            gaps = ", ".join(f"{low:.6g} to {high:.6g}" for low, high in self.open[:3])
            return f"stopped after {largest} steps; not covered: {gaps} rad/s"
        least = float(self.found.upper.max())
        message = f"{len(self.intervals)} intervals"
        if self.beta > (1 + 2 * asked) * least and self.beta > NOTHING:
            message += f"; {self.beta - least:.3g} above the largest bound at one frequency"
        return message

    def _step(self) -> None:
        index = self._worst()
        omega, bound = float(self.found.omega[index]), float(self.found.upper[index])
        if bound * (1 + 0.5 * self.tolerance) > self.beta:
            self.beta = bound * (1 + self.tolerance)
        D_left, D_right, G = (
            part[index] for part in (self.found.D_left, self.found.D_right, self.found.G)
        )
        ends = certified_interval(self.system, D_left, D_right, G, self.beta, omega)
        if ends is None or not _wide(*ends):
            self.beta *= 1 + self.tolerance
            return
        self.intervals.append(Interval(*ends, omega, D_left, D_right, G))
        self.open = [gap for one in self.open for gap in _without(one, ends)]

    def _linear_step(self, gap: tuple[float, float]) -> None:
        """Cover the middle of a gap with multipliers between those of its ends, or halve it."""
        low, high = gap
        self._at(low), self._at(high)
        indices = [self._at(low), self._at(high)]  # the second may have moved the first
        for index in indices:
            bound = float(self.found.upper[index])
            if bound * (1 + 0.5 * self.tolerance) > self.beta:
                self.beta = bound * (1 + self.tolerance)
        parts = self.found.D_left, self.found.D_right, self.found.G
        first, second = ([part[index] for part in parts] for index in indices)
        # Multiples of multipliers prove the same; nearly equal ones are looked for.
        with np.errstate(all="ignore"):
            ratio = np.exp(np.mean(np.log(np.diag(first[1]).real / np.diag(second[1]).real)))
        pairs = list(zip(first, second, strict=True))
        middle = [(a + ratio * b) / 2 for a, b in pairs]
        change = [(ratio * b - a) / 2 for a, b in pairs]
        omega, half = (low + high) / 2, (high - low) / 2
        ends = certified_between(self.system, middle, change, self.beta, omega, half)
        if ends is not None and _wide(*ends):
            slopes = change[0] / half, change[1] / half, change[2] / half
            self.intervals.append(Interval(*ends, omega, middle[0], middle[1], middle[2], slopes))
            self.open = [rest for one in self.open for rest in _without(one, ends)]
        else:
            self.open.remove(gap)
            between = _middle(low, high) if low > 0 else omega
            self.open += [(low, between), (between, high)]

    def _at(self, omega: float) -> int:
        """Index of a frequency, bounded there if it is a new one."""
        index = int(np.searchsorted(self.found.omega, omega))
        if index < len(self.found.omega) and self.found.omega[index] == omega:
            return index
        self.found = self.found.joined(self.bounds_at(np.array([omega])))
        return int(np.searchsorted(self.found.omega, omega))

    def _worst(self) -> int:
        """Index of the open frequency with the largest bound; some are added where none is open."""
        omega = self.found.omega
        inside = np.zeros(len(omega), dtype=bool)
        for low, high in self.open:
            inside |= (omega >= low) & (omega <= high)
        if not inside.any():
            widest = sorted(self.open, key=_width)[-TOGETHER:]
            new = np.unique([_middle(*gap) for gap in widest])
            self.found = self.found.joined(self.bounds_at(new))
            return int(np.flatnonzero(self.found.omega == new[0])[0])
        return int(np.argmax(np.where(inside, self.found.upper, -1.0)))


def _wide(low: float, high: float) -> bool:
    """Whether an interval is more than rounding."""
    return high - low > 1e-11 * low if math.isfinite(high) else True


def _without(gap: tuple[float, float], ends: tuple[float, float]) -> list[tuple[float, float]]:
    """What an interval leaves of a gap."""
    if ends[1] < gap[0] or ends[0] > gap[1]:
        return [gap]
    left = [(gap[0], ends[0])] if ends[0] > gap[0] else []
    return left + ([(ends[1], gap[1])] if ends[1] < gap[1] else [])


def _middle(low: float, high: float) -> float:
    """Between two frequencies; the grid has 0 and infinity, which are covered first."""
    return math.sqrt(low) * math.sqrt(high)


def _width(gap: tuple[float, float]) -> float:
    return math.log(gap[1] / gap[0])
