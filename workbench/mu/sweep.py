"""Bounds of mu over frequency, on a grid that finds narrow peaks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import InputError
from workbench.mu.given import need_structure
from workbench.mu.hamiltonian import StableSystem, stable_system
from workbench.mu.lower import lower_bound
from workbench.mu.upper import upper_bound
from workbench.structure import Structure

Array = NDArray[Any]
Real = NDArray[np.float64]
PER_DECADE = 8
BEYOND = 100.0
"""How far the grid reaches beyond the slowest and the fastest pole, as a factor."""
LIGHT = 0.3
"""Damping ratio below which a pole has frequencies of its own."""
WIDTHS = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
"""Where those are, in half-widths of its resonance on either side."""
LOG_STEP = 0.2
"""Change of the bound's logarithm between neighbours that asks for one more between them."""
FLAT = 1e-3
"""A maximum is resolved where its neighbours are within this, relative."""
LOW = 1e-3
"""Bounds below this share of the largest are not refined."""
MOST = 3000
"""Points at which refinement stops."""


@dataclass(frozen=True)
class UpperSweep:
    """Upper bounds over frequency with their multipliers.

    ``omega`` (F,) [rad/s], increasing, ``M`` (F, c, r), ``upper`` (F,), and ``D_left``
    (F, c, c), ``D_right`` (F, r, r), ``G`` (F, r, c) as `upper_bound` has them.
    """

    omega: Real
    M: Array
    upper: Real
    D_left: Array
    D_right: Array
    G: Array

    def within(self, low: float, high: float) -> UpperSweep:
        """At the frequencies [rad/s] from one to another."""
        inside = (self.omega >= low) & (self.omega <= high)
        names = ("omega", "M", "upper", "D_left", "D_right", "G")
        return UpperSweep(*(getattr(self, name)[inside] for name in names))

    def joined(self, other: UpperSweep) -> UpperSweep:
        """Both together, in the order of frequencies; of equal ones the first."""
        omega, first = np.unique(np.concatenate([self.omega, other.omega]), return_index=True)
        names = ("M", "upper", "D_left", "D_right", "G")
        parts = (np.concatenate([getattr(self, n), getattr(other, n)])[first] for n in names)
        return UpperSweep(omega, *parts)


@dataclass(frozen=True)
class Sweep(UpperSweep):
    """With lower bounds ``lower`` (F,) and the ``Delta`` (F, r, c) that prove them."""

    lower: Real
    Delta: Array


def sweep(
    system: Any, structure: Structure, omega: ArrayLike | None = None, lower: str = "power"
) -> Sweep:
    """Bounds of mu of a stable system over frequency.

    Parameters
    ----------
    system
        StateSpace or TransferFunction, continuous time, what Delta closes.
    omega
        Frequencies [rad/s], not negative, infinity allowed. None: from the poles, and refined
        where the bound changes; 0 and infinity are among them.
    lower
        Method of `lower_bound`.

    Returns
    -------
    Sweep
        What lies between its frequencies is not certified; for that see `peak`.

    Raises
    ------
    InputError
        As `stable_system`; a system that does not fit the structure; no or wrong frequencies.
    """
    stable = fitting(system, structure)
    if omega is None:
        found = refined(stable, structure)
    else:
        try:
            points = np.unique(np.asarray(omega, dtype=float))
        except (TypeError, ValueError):
            raise InputError(f"omega must be real frequencies [rad/s], not {omega!r}") from None
        if not points.size or np.isnan(points).any() or points[0] < 0:
            raise InputError("omega must have frequencies [rad/s], none of them negative or NaN")
        found = bounds_at(stable, structure, points)
    below = lower_bound(found.M, structure, lower)
    parts = (found.omega, found.M, found.upper, found.D_left, found.D_right, found.G)
    return Sweep(*parts, below.value, below.Delta)


def fitting(system: Any, structure: Structure) -> StableSystem:
    """The stable system that fits the structure; raises InputError for any other."""
    need_structure(structure)
    stable = stable_system(system)
    structure.check(stable.D)
    return stable


def bounds_at(system: StableSystem, structure: Structure, omega: Real) -> UpperSweep:
    """Upper bounds at frequencies [rad/s] (F,), increasing."""
    M = system.response(omega)
    bound = upper_bound(M, structure)
    return UpperSweep(omega, M, bound.value, bound.D_left, bound.D_right, bound.G)


def starting_grid(poles: Array) -> Real:
    """Frequencies [rad/s] that a system's poles (n,) ask for, with 0 and infinity."""
    natural = np.abs(poles)
    if not len(natural):
        return np.array([0.0, np.inf])
    low, high = natural.min() / BEYOND, natural.max() * BEYOND
    count = int(np.ceil(PER_DECADE * np.log10(high / low))) + 1
    light = poles[(poles.imag > 0) & (-poles.real < LIGHT * natural)]
    near = light.imag[:, None] - light.real[:, None] * np.concatenate([WIDTHS, -WIDTHS])
    parts = [[0.0, np.inf], np.geomspace(low, high, count), natural, near.ravel()]
    grid: Real = np.unique(np.concatenate(parts))
    return grid[grid >= 0.0]


def refined(system: StableSystem, structure: Structure) -> UpperSweep:
    """Upper bounds on the grid of the poles, refined where the bound is steep or has a maximum."""
    found = bounds_at(system, structure, starting_grid(system.poles))
    while len(found.omega) < MOST:
        new = _wanted(found.omega, found.upper)
        if not new.size:
            break
        found = found.joined(bounds_at(system, structure, new))
    return found


def _wanted(omega: Real, bound: Real) -> Real:
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
    middle: Real = np.sqrt(w[1:] * w[:-1])[split]
    return middle
