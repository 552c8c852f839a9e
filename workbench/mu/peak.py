"""The supremum of mu over all frequencies, certified between grid points.

For a bound beta, multipliers D and G of one frequency prove it on a whole interval around (see
`hamiltonian`). Intervals are removed from the axis, worst frequencies first, and beta rises where
a bound lies above it, until nothing of [0, infinity] is left. Where mu is flat such intervals are
short, and multipliers that change over frequency take over (see `between`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Real as Number
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.mu.between import certified_between
from workbench.mu.given import need_count, need_tolerance
from workbench.mu.hamiltonian import StableSystem, certified_interval, stable_system
from workbench.mu.lower import lower_bound
from workbench.mu.sweep import UpperSweep, bounds_at, fitting, refined
from workbench.structure import Complex, Real, Structure

Array = NDArray[Any]
CLOSE = 0.97
"""Share of the largest bound at which a frequency is worth a lower bound."""
CANDIDATES = 60
THOROUGH = 6
"""Frequencies with a quick, and of those with a thorough lower bound."""
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


@dataclass(frozen=True, eq=False)
class Peak:
    """The supremum of mu over a band lies between ``lower`` and ``upper``.

    ``Delta`` (r, c) makes I - M(j omega) Delta singular and has largest singular value 1 / lower;
    where lower is 0 it has NaN. ``omega`` [rad/s] is its frequency, or without one that of the
    largest bound. ``intervals`` cover the band unless upper is infinite. ``complex_part``
    is what was added to real scalars, as a share of them: the peak is that of the larger set.
    """

    lower: float
    upper: float
    omega: float
    Delta: Array
    intervals: tuple[Interval, ...]
    message: str
    complex_part: float = 0.0

    def __repr__(self) -> str:
        return f"Peak(lower={self.lower:.6g}, upper={self.upper:.6g}, omega={self.omega:.6g} rad/s)"


def peak(
    system: Any,
    structure: Structure,
    tolerance: float = 1e-3,
    *,
    complex_part: float = 0.0,
    band: tuple[float, float] = (0.0, math.inf),
    steps: int = 500,
) -> Peak:
    """Bounds of the supremum of mu over a band of frequencies, its ends included.

    Parameters
    ----------
    system
        StateSpace or TransferFunction (c outputs, r inputs), stable, continuous time: what Delta
        closes.
    structure
        Blocks of Delta.
    tolerance
        How far the bound may lie above the largest upper bound at any one frequency, relative.
    complex_part
        Complex uncertainty added to every real scalar, as a share of it; see `regularised`.
    band
        From and to [rad/s]; all frequencies with 0 and infinity.
    steps
        Intervals after which the tolerance is made ten times as large, and again after as many.

    Returns
    -------
    Peak
        The message says where the tolerance was missed.

    Raises
    ------
    InputError
        A system that does not fit the structure, unstable, improper or sampled; real scalars only
        without a complex part; a tolerance, complex part, band or steps that make no sense.
    """
    need_tolerance(tolerance)
    need_count("steps", steps)
    low, high = band
    if not 0.0 <= low < high:
        raise InputError(f"band is {band}; it must be two frequencies [rad/s], the lower one first")
    original = fitting(system, structure)
    if complex_part:
        stable, larger = regularised(original, structure, complex_part)
    elif all(isinstance(block, Real) for block in structure):
        raise InputError(
            "the structure has real scalars only: mu is then not continuous in frequency, a peak "
            "may stand at a single frequency that no bound shows; give complex_part, for instance "
            "0.01, or add the complex block of a performance channel"
        )
    else:
        stable, larger = original, structure
    ends = bounds_at(stable, larger, np.array(band))
    found = refined(stable, larger).joined(ends).within(*band)
    cover = _Cover(stable, larger, tolerance, found)
    message = cover.complete(steps)
    lower, omega, Delta = _lower(cover.found, larger)
    intervals = tuple(sorted(cover.intervals, key=lambda interval: interval.low))
    if complex_part:
        Delta = _summed(Delta, structure, complex_part)
    return Peak(lower, cover.proven, omega, Delta, intervals, message, complex_part)


def regularised(
    system: Any, structure: Structure, complex_part: float
) -> tuple[StableSystem, Structure]:
    """A system and structure with complex scalars of size `complex_part` added to the real ones.

    Real scalars delta become delta + complex_part * delta_c; the complex blocks come last.

    Raises
    ------
    InputError
        `complex_part` is not positive, or there is no real scalar.

    References
    ----------
    Packard, Pandey, Continuity properties of the real/complex structured singular value, IEEE
    Trans. Automatic Control 38 (1993) 415-428.
    """
    if not (isinstance(complex_part, Number) and 0.0 < complex_part < math.inf):
        raise InputError(
            f"complex_part is {complex_part!r}; it must be a number, positive and finite"
        )
    places = zip(structure, structure.column_slices, structure.row_slices, strict=True)
    real = [(block, column, row) for block, column, row in places if isinstance(block, Real)]
    if not real:
        raise InputError(
            f"the structure {structure.to_pairs()} has no real scalar; leave complex_part out"
        )
    stable = stable_system(system)
    outputs = np.concatenate([np.arange(stable.D.shape[0])[column] for _, column, _ in real])
    inputs = np.concatenate([np.arange(stable.D.shape[1])[row] for _, _, row in real])
    C = np.vstack([stable.C, complex_part * stable.C[outputs]])
    B = np.hstack([stable.B, stable.B[:, inputs]])
    D = np.hstack([stable.D, stable.D[:, inputs]])
    D = np.vstack([D, complex_part * D[outputs]])
    added = [Complex(block.rows, f"{block.name} complex".strip()) for block, _, _ in real]
    return replace(stable, B=B, C=C, D=D), Structure((*structure, *added))


def _summed(Delta: Array, structure: Structure, complex_part: float) -> Array:
    """The perturbation of the original system that one of the regularised system is."""
    whole = Delta[: structure.rows, : structure.columns].copy()
    at = structure.rows, structure.columns
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        if isinstance(block, Real):
            n = block.rows
            whole[row, column] += complex_part * Delta[at[0] : at[0] + n, at[1] : at[1] + n]
            at = at[0] + n, at[1] + n
    return whole


class _Cover:
    """The band, and what of it is covered at the present beta."""

    def __init__(
        self, system: StableSystem, structure: Structure, tolerance: float, found: UpperSweep
    ) -> None:
        self.system, self.structure = system, structure
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
        self.found = self.found.joined(bounds_at(self.system, self.structure, np.array([omega])))
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
            self.found = self.found.joined(bounds_at(self.system, self.structure, new))
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


def _lower(found: UpperSweep, structure: Structure) -> tuple[float, float, Array]:
    """The largest lower bound near the largest upper ones, its frequency and Delta."""
    order = np.argsort(-found.upper)[:CANDIDATES]
    order = order[found.upper[order] >= CLOSE * found.upper[order[0]]]
    quick = lower_bound(found.M[order], structure, "power")
    chosen = np.unique([order[0], *order[np.argsort(-quick.value)[:THOROUGH]]])
    thorough = lower_bound(found.M[chosen], structure)
    value = np.concatenate([quick.value, thorough.value])
    best = int(np.argmax(value))
    omega = found.omega[np.concatenate([order, chosen])][best if value[best] > 0 else 0]
    Delta = np.concatenate([quick.Delta, thorough.Delta])[best]
    return float(value[best]), float(omega), Delta
