"""Crossings and bandwidths of single loops, from their responses.

    L = loop transfer function, closed with negative feedback: S = 1 / (1 + L), T = L / (1 + L)

in continuous or discrete time. Responses are used instead of polynomials, because the polynomials
of a sampled loop with an integrator lose all digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_array
from workbench.systems.conversion import as_system
from workbench.systems.frequency_grid import GRID_REACH, starting_grid
from workbench.systems.generalised_plant import response
from workbench.systems.range_hints import warn_far_frequencies

NYQUIST_SHARE = 0.999
"""The search in a sampled loop ends at this share of half its sampling frequency, where the
response of a hold is still regular."""
SEARCH_POINTS = 600
"""Least number of frequencies of the default search grid. Two crossings between neighbouring
frequencies are missed.
"""
LAST_POINTS = 33
"""Number of frequencies in the interval that contains the last crossing: evaluating them is faster
than bisection.
"""
HALF_POWER = 2**-0.5
"""Magnitude at -3 dB, which defines the bandwidths of S and T."""

POLE_STEP = 1e-9
"""Relative step away from the frequency of an undamped pole, where the response is infinite."""

Curve = Callable[[RealArray], Any]
"""Real values (F,) of a continuous function at frequencies [Hz] (F,)."""


def loop_response(loop: StateSpace, frequency_hz: RealArray) -> ComplexArray:
    """Response (F,) of a loop with one input and one output at `frequency_hz` [Hz] (F,).

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.systems import loop_response
    >>> L = control.ss(control.tf([1.0], [1.0, 1.0]))
    >>> loop_response(L, np.array([0.0, 1 / (2 * np.pi)])).round(6).tolist()
    [(1+0j), (0.5-0.5j)]
    """
    values: ComplexArray = response(loop, 2 * np.pi * frequency_hz)[:, 0, 0]
    return values


def search_grid(loop: StateSpace) -> RealArray:
    """Frequencies [Hz] (F,) between which crossings of a loop are searched.

    They reach from below the slowest to above the fastest pole of the loop, open and closed; in a
    sampled loop to just below half its sampling frequency.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.systems.margins import search_grid
    >>> grid = search_grid(control.ss(control.tf([1.0], [1.0, 1.0])))  # poles 1 and 2 rad/s
    >>> (2 * np.pi * grid[[0, -1]]).round(6).tolist()
    [0.01, 200.0]
    """
    loop = as_system(loop, "loop")
    direct = 1.0 + loop.D[0, 0]
    with np.errstate(all="ignore"):
        back = loop.A - loop.B @ loop.C / direct if direct else np.zeros((0, 0))
    if not np.isfinite(back).all():
        raise InputError("the gain of the loop overflows doubles; measure its signals otherwise")
    closed = [np.linalg.eigvals(back)]
    poles, end = np.concatenate([loop.poles(), *closed]).astype(complex), math.inf
    if loop.dt:
        period = 1.0 if loop.dt is True else loop.dt
        poles = np.log(poles[np.abs(poles) > 0]) / period
        end = np.pi * NYQUIST_SHARE / period
    omega = starting_grid(poles)
    omega = omega[(omega > 0) & (omega < end)]
    if not omega.size:  # only poles at 0: nothing crosses, unless the loop is sampled
        omega = np.array([1.0 / GRID_REACH, 1.0]) * (end if loop.dt else 1.0)
    ends = omega[0], end if loop.dt else omega[-1]
    every: RealArray = np.union1d(np.geomspace(*ends, SEARCH_POINTS), omega) / (2 * np.pi)
    return every


def crossings(curve: Curve, frequency_hz: RealArray) -> RealArray:
    """Frequencies [Hz] of sign changes of a continuous curve.

    At most one is found in each interval of the grid ``frequency_hz`` [Hz].

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.systems import crossings
    >>> crossings(lambda f: f**2 - 4.0, np.linspace(0.6, 10.0, 20)).round(6).tolist()
    [2.0]
    """
    from scipy.optimize.elementwise import find_root

    ends = np.log(frequency_hz)
    # as in the search, for which a crossing may lie exactly at a frequency of the grid
    before = np.flatnonzero(np.diff(curve(np.exp(ends)) > 0))
    found = find_root(lambda x: curve(np.exp(x)), (ends[before], ends[before + 1]))
    roots: RealArray = np.exp(found.x)
    return roots


def positive_bands(curve: Curve, frequency_hz: RealArray) -> list[tuple[float, float]]:
    """Frequency ranges [Hz] within a grid `frequency_hz` [Hz] in which a curve is positive.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.systems import positive_bands
    >>> found = positive_bands(lambda f: 4.0 - f**2, np.linspace(0.5, 10.0, 20))
    >>> [round(float(end), 6) for end in found[0]]
    [0.5, 2.0]
    """
    edges = [frequency_hz[0], *crossings(curve, frequency_hz), frequency_hz[-1]]
    middle = np.sqrt(np.multiply(edges[1:], edges[:-1]))
    inside = curve(middle) > 0
    return [
        (float(low), float(high))
        for low, high, positive in zip(edges[:-1], edges[1:], inside, strict=True)
        if positive
    ]


def highest_crossover(plant: StateSpace, K: StateSpace) -> float:
    """Highest frequency [Hz] at which the largest singular value of the loop gain G K is 1.

    0 if it is smaller at all frequencies, infinite if it stays larger up to infinity. The search
    covers the frequencies of `starting_grid`, and goes beyond them as long as the loop gain is
    larger than 1.
    """
    dt = plant.dt or K.dt
    poles, end = np.concatenate([plant.poles(), K.poles()]).astype(complex), math.inf
    if dt:
        period = 1.0 if dt is True else dt
        poles = np.log(poles[np.abs(poles) > 0]) / period
        end = np.pi * NYQUIST_SHARE / period
    elif np.linalg.norm(plant.D @ K.D, 2) >= 1:
        return math.inf
    moving = poles[np.abs(poles) > 0]
    undamped = np.unique(np.abs(poles.imag[np.abs(poles.real) <= POLE_STEP * np.abs(poles)]))
    omega = starting_grid(moving)
    omega = omega[(omega > 0) & (omega < end)]

    def excess(at: RealArray) -> RealArray:
        omega = 2 * np.pi * at
        # close to a pole the gain counts as infinite
        near = np.isclose(omega[:, None], undamped, rtol=POLE_STEP / 2, atol=0.0).any(axis=1)
        omega = np.where(near, omega * (1.0 + POLE_STEP), omega)
        values = np.linalg.svd(response(plant, omega) @ response(K, omega), compute_uv=False)
        return np.log(np.maximum(values.max(axis=1, initial=0.0), 1e-300))

    frequency = (omega if omega.size else np.array([min(1.0, end / 2)])) / (2 * np.pi)
    values = excess(frequency)
    while values[-1] > 0:
        if frequency[-1] * 2 * np.pi >= end:
            return math.inf
        frequency = np.append(frequency, min(2 * frequency[-1], end / (2 * np.pi)))
        values = np.append(values, excess(frequency[-1:]))
    if len(moving) < len(poles) and values.max() < 0:  # below the grid an integrator crosses
        below = np.geomspace(1e-12, 0.5, 100) * frequency[0]
        frequency, values = np.concatenate([below, frequency]), np.append(excess(below), values)
    changes = np.flatnonzero(np.diff(np.sign(values)))
    if not changes.size:
        return 0.0
    low, high = frequency[changes[-1]], frequency[changes[-1] + 1]
    # Rounding may move a crossing at the lower end out of the range.
    return float(crossings(excess, np.geomspace(low, high, LAST_POINTS)).max(initial=low))


def bandwidths(loop: StateSpace, *, frequency_hz: ArrayLike | None = None) -> dict[str, float]:
    """Bandwidths [Hz] of a closed loop by three definitions; NaN where there is no crossing.

    "S": |S| stays under -3 dB below it; "crossover": |L| stays under 1 above it; "T": |T| stays
    under -3 dB above it. `frequency_hz` [Hz] (F,): search grid, None: `search_grid(loop)`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.systems import bandwidths
    >>> L = control.ss(control.tf([100.0], [1.0, 0.0]))
    >>> round(2 * np.pi * bandwidths(L)["crossover"], 4)
    100.0
    """

    grid = _grid(loop, frequency_hz)
    loop = as_system(loop, "loop")

    def L(at: RealArray) -> ComplexArray:
        return loop_response(loop, at)

    sensitive = crossings(lambda f: abs(1 / (1 + L(f))) - HALF_POWER, grid)
    unity = crossings(lambda f: np.log(abs(L(f))), grid)
    complementary = crossings(lambda f: abs(L(f) / (1 + L(f))) - HALF_POWER, grid)
    return {
        "S": float(sensitive[0]) if sensitive.size else math.nan,
        "crossover": float(unity[-1]) if unity.size else math.nan,
        "T": float(complementary[-1]) if complementary.size else math.nan,
    }


def modulus_margin(L: ArrayLike) -> float:
    """Smallest |1 + L| of a loop's responses (...,), the distance from -1: 1 / max |S|.

    Examples
    --------
    >>> from workbench.systems import modulus_margin
    >>> modulus_margin([-0.5, -0.5 - 0.5j, -1j])
    0.5
    """
    responses = as_array(L, "L", dtype=complex)
    if not responses.size:
        raise InputError("L has no response")
    return float(abs(1.0 + responses).min())


def _grid(loop: StateSpace, frequency: ArrayLike | None) -> RealArray:
    """The grid of a search; raises InputError for anything but a loop and rising frequencies."""
    if not hasattr(loop, "issiso") or isinstance(loop, type) or not loop.issiso():
        raise InputError(f"a system of one input and one output is needed, not {loop!r}")
    if frequency is None:
        return search_grid(loop)
    grid = as_array(frequency, "frequency")
    if grid.ndim != 1 or grid.size < 2 or not (grid[0] > 0 and (np.diff(grid) > 0).all()):
        raise InputError(f"frequency is {frequency!r}; two or more rising frequencies are needed")
    warn_far_frequencies(2 * np.pi * grid, loop)
    return grid
