"""Hints on frequencies and sampling times so far from a system that their unit may be mistaken."""

from __future__ import annotations

import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import RangeWarning
from workbench.systems.balancing import balancing
from workbench.systems.realisation import pole_sizes, root_sizes

FAR = 100.0
"""Ratio to the fastest or slowest pole from which frequencies and times count as out of range: Hz
for rad/s is a factor of 6, and within a plant's range; milliseconds for seconds is one of 1000."""
OFTEN = 10.0
"""Samples within the shortest time constant of a loop that is sampled as often as is usual; a loop
that is sampled a hundred times as often is out of range."""
BEYOND = 1.01
"""Ratio from which a zero is faster than the fastest pole; nearer ones would differ by rounding."""
LIBRARY = __name__.partition(".")[0]


def warn_far_frequencies(omega: ArrayLike, system: Any) -> None:
    """Warn of frequencies [rad/s] all far above, or all far below, a system's poles and zeros.

    Frequencies 0 and infinity count for nothing. Nothing is far from a system whose poles are all
    0, or that has none.
    """
    import control

    given = np.abs(np.atleast_1d(np.asarray(omega, dtype=float)))
    given = given[np.isfinite(given) & (given > 0)]
    if not given.size:
        return
    low, high = float(given.min()), float(given.max())
    system = control.ss(system)
    poles = _pole_sizes(system)
    if not poles.size or (poles.min() / FAR <= high and low <= FAR * poles.max()):
        return
    zeros = _zero_sizes(system)
    fastest, slowest, fast, slow = poles.max(), poles.min(), "pole", "pole"
    if zeros.size and zeros.max() > BEYOND * fastest:
        fastest, fast = zeros.max(), "zero"
    if zeros.size and zeros.min() < slowest / BEYOND:
        slowest, slow = zeros.min(), "zero"
    run = f"{low:.3g} to {high:.3g}" if high > low else f"{low:.3g}"
    told = f"{given.size} given, {run} rad/s"
    if low > FAR * fastest:
        _warn(
            f"all frequencies lie above 100 times the fastest {fast}: are they in Hz? ({told}; the "
            f"{fast} is at {fastest:.3g} rad/s, or is the system in other units of time?)"
        )
    elif high < slowest / FAR:
        _warn(
            f"all frequencies lie below 1/100 of the slowest {slow}: are they in kHz? ({told}; the "
            f"{slow} is at {slowest:.3g} rad/s, or is the system in other units of time?)"
        )


def warn_long_period(period: float, system: StateSpace, called: str) -> bool:
    """Warn of a sampling time [s] within 1/100 of which all of a continuous system settles.

    Returns whether it did. ``called`` is what the message calls the system.
    """
    poles = _pole_sizes(system)
    if not poles.size or period * poles.min() <= FAR:
        return False
    slowest = min([poles.min(), *_zero_sizes(system)])
    if period * slowest <= FAR:
        return False
    _warn(
        f"the sampling time, {period:.3g} s, is above 100 times the {called}'s longest time "
        f"constant, {1 / slowest:.3g} s: is it in ms, or the {called} in other units of time?"
    )
    return True


def warn_far_period(period: float, plant: StateSpace, loop: StateSpace) -> None:
    """Warn of a sampling time [s] far longer, or far shorter, than what happens in a loop.

    It is too long for a continuous plant whose slowest pole or zero settles within 1/100 of a
    sample, and too short for a sampled loop whose fastest pole takes 1000 samples to move.
    """
    if warn_long_period(period, plant, "plant"):
        return
    closed = _pole_sizes(loop)
    if closed.size and period * closed.max() < 1 / (FAR * OFTEN):
        _warn(
            f"the sampling time, {period:.3g} s, is below 1/1000 of the loop's shortest time "
            f"constant, {1 / closed.max():.3g} s: is the plant in other units of time?"
        )


def _pole_sizes(system: StateSpace) -> RealArray:
    """Sizes [rad/s] of the poles that are not 0; none where rounding explains the largest.

    The poles of a chain of n integrators are computed as roots of order n of rounding errors.
    """
    sizes = pole_sizes(system)
    sizes = sizes[sizes > 0]
    if not sizes.size:  # gains, integrators and delays by whole samples
        return sizes
    rows, columns = balancing(system.A, system.nstates)
    size = np.linalg.norm(rows[:, None] * system.A * columns, 2) / (system.dt or 1.0)
    rounding = np.finfo(float).eps ** (1 / system.nstates) * size
    return sizes if sizes.max() > rounding else sizes[:0]


def _zero_sizes(system: StateSpace) -> RealArray:
    """Sizes [rad/s] of the zeros of all entries that are not 0."""
    rows, columns = range(system.noutputs), range(system.ninputs)
    found = [system[row, column].zeros() for row in rows for column in columns]
    sizes = root_sizes(np.concatenate(found), system.dt)
    return sizes[sizes > 0]


def _warn(message: str) -> None:
    """Warn at the line outside of this library that led here."""
    level, frame = 1, sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == LIBRARY:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, RangeWarning, stacklevel=level)
