"""Warnings about frequencies and sampling times whose unit may be wrong for a system."""

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

FAR_RATIO = 100.0
"""Frequencies and times count as out of range from this ratio to the fastest or slowest pole on. Hz
instead of rad/s is a factor of 6, within a plant's usual range; milliseconds instead of seconds is
a factor of 1000.
"""
USUAL_SAMPLES = 10.0
"""Usual number of samples within the shortest time constant of a loop. A loop that is sampled a
hundred times as often is out of range.
"""
FASTER_RATIO = 1.01
"""A zero counts as faster than the fastest pole from this ratio on; a smaller ratio may be
rounding.
"""
LIBRARY = __name__.partition(".")[0]


def warn_far_frequencies(omega: ArrayLike, system: Any) -> None:
    """Warn if all frequencies [rad/s] are far above, or all far below, a system's poles and zeros.

    Frequencies 0 and infinity are ignored. There is no warning for a system without poles, or with
    poles at 0 only.
    """
    import control

    given = np.abs(np.atleast_1d(np.asarray(omega, dtype=float)))
    given = given[np.isfinite(given) & (given > 0)]
    if not given.size:
        return
    low, high = float(given.min()), float(given.max())
    system = control.ss(system)
    poles = _pole_sizes(system)
    if not poles.size or (poles.min() / FAR_RATIO <= high and low <= FAR_RATIO * poles.max()):
        return
    zeros = _zero_sizes(system)
    fastest, slowest, fast, slow = poles.max(), poles.min(), "pole", "pole"
    if zeros.size and zeros.max() > FASTER_RATIO * fastest:
        fastest, fast = zeros.max(), "zero"
    if zeros.size and zeros.min() < slowest / FASTER_RATIO:
        slowest, slow = zeros.min(), "zero"
    run = f"{low:.3g} to {high:.3g}" if high > low else f"{low:.3g}"
    told = f"{given.size} given, {run} rad/s"
    if low > FAR_RATIO * fastest:
        _warn(
            f"all frequencies lie above 100 times the fastest {fast}: are they in Hz? ({told}; the "
            f"{fast} is at {fastest:.3g} rad/s, or is the system in other units of time?)"
        )
    elif high < slowest / FAR_RATIO:
        _warn(
            f"all frequencies lie below 1/100 of the slowest {slow}: are they in kHz? ({told}; the "
            f"{slow} is at {slowest:.3g} rad/s, or is the system in other units of time?)"
        )


def warn_long_period(period: float, system: StateSpace, called: str) -> bool:
    """Warn if a continuous system settles completely within 1/100 of the sampling time [s].

    Returns whether it warned. ``called`` is the name of the system in the message.
    """
    poles = _pole_sizes(system)
    if not poles.size or period * poles.min() <= FAR_RATIO:
        return False
    slowest = min([poles.min(), *_zero_sizes(system)])
    if period * slowest <= FAR_RATIO:
        return False
    _warn(
        f"the sampling time, {period:.3g} s, is above 100 times the {called}'s longest time "
        f"constant, {1 / slowest:.3g} s: is it in ms, or the {called} in other units of time?"
    )
    return True


def warn_far_period(period: float, plant: StateSpace, loop: StateSpace) -> None:
    """Warn if a sampling time [s] is far longer, or far shorter, than the time constants of a loop.

    It is too long for a continuous plant whose slowest pole or zero settles within 1/100 of a
    sample, and too short for a sampled loop whose fastest pole takes 1000 samples to move.
    """
    if warn_long_period(period, plant, "plant"):
        return
    closed = _pole_sizes(loop)
    if closed.size and period * closed.max() < 1 / (FAR_RATIO * USUAL_SAMPLES):
        _warn(
            f"the sampling time, {period:.3g} s, is below 1/1000 of the loop's shortest time "
            f"constant, {1 / closed.max():.3g} s: is the plant in other units of time?"
        )


def _pole_sizes(system: StateSpace) -> RealArray:
    """Sizes [rad/s] of the nonzero poles; empty if rounding explains the largest one.

    The poles of a chain of n integrators are computed as roots of order n of rounding errors.
    """
    sizes = pole_sizes(system)
    sizes = sizes[sizes > 0]
    if not sizes.size:  # only gains, integrators and delays by whole samples
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
    """Warn with the line outside this library from which the call came."""
    level, frame = 1, sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] == LIBRARY:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, RangeWarning, stacklevel=level)
