"""Loops with dead time, by their responses alone: poles are counted by turns about 0.

f(s) = det(s I - A + k B C exp(-s T) / (1 + k D exp(-s T))) (1 + k D exp(-s T)) is entire, and its
zeros are the closed loop's poles. Divided by (s + rho)^n, f has no pole right of the axis and tends
to 1 + k D exp(-s T), so that its turns along the axis count the closed loop's poles right of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

POINTS = 2000
"""Number of frequencies of the first grid, on a logarithmic scale."""
TURN = 0.3
"""Largest turn [rad] between neighbouring frequencies."""
REFINEMENTS = 12
"""Largest number of refinements of a grid whose neighbours differ by a larger turn."""
DECADES = 6
"""Decades of frequency below and above the poles over which a loop is evaluated."""


def counted_poles(system: Any, delay: float, gain: float = 1.0) -> int:
    """Number of closed-loop poles right of the axis for 1 + gain R exp(-s delay), with R a
    StateSpace.
    """
    rho = _speed(system)
    return turns_right(
        lambda omega: _closed(system, omega, delay, gain, rho), _frequencies(rho, delay)
    )


def turns_right(function: Callable[[RealArray], ComplexArray], omega: RealArray) -> int:
    """Number of zeros right of the axis of a function given at frequencies from 0 on (F,), by its
    turns about 0.

    The function must have no poles there, and must be in the right half plane at infinity.
    """
    values = function(omega)
    for _ in range(REFINEMENTS):
        steps = np.abs(np.angle(values[1:] / values[:-1]))
        wide = np.flatnonzero((steps > TURN) | (np.abs(np.diff(np.log(np.abs(values)))) > 1.0))
        if not wide.size:
            break
        middle = (omega[wide] + omega[wide + 1]) / 2
        omega, order = np.unique(np.append(omega, middle), return_index=True)
        values = np.append(values, function(middle))[order]
    # The values cover half of the axis, upwards. The axis is run through downwards, to have the
    # right half plane inside.
    turned = float(np.angle(values[1:] / values[:-1]).sum()) + float(np.angle(1.0 / values[-1]))
    return round(-turned / math.pi)


def tried_distance(system: Any, delay: float) -> float:
    """The least |1 + R exp(-s delay)| over the frequencies tried."""
    rho = _speed(system)
    omega = _frequencies(rho, delay)[1:]
    for _ in range(4):
        s = 1j * omega
        distance = np.abs(1.0 + _response(system, s) * np.exp(-s * delay))
        k = int(np.argmin(distance))
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)]
        omega = np.linspace(low, high, 100)
    return float(min(distance.min(), 1.0 + abs(system.D[0, 0])))


def tried_size(system: Any, delay: float, skew: float, pair: bool) -> float:
    """The least |delta| that breaks the loop, over the frequencies tried.

    ``pair``: plant and controller have a factor each. The whole L is then put into the plant, and
    the closed loop's matrix is scaled by numbers that are tried too.
    """
    rho = _speed(system)
    omega, least = _frequencies(rho, delay)[1:], math.inf
    for _ in range(4):
        s = 1j * omega
        L = _response(system, s) * np.exp(-s * delay)
        sizes = _sizes(L, skew, pair)
        k = int(np.argmin(sizes))
        least = min(least, float(sizes[k]))
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)]
        omega = np.linspace(low, high, 100)
    return least


def distance_at(system: Any, delay: float, omega: float, factor: complex) -> float:
    """|1 + factor L| divided by 1 + |factor L| at a frequency [rad/s]; at a pole |factor|, which
    must be 0.
    """
    s = np.array([1j * omega])
    try:
        L = complex(_response(system, s)[0] * np.exp(-s[0] * delay))
    except np.linalg.LinAlgError:
        return abs(factor)
    return abs(1.0 + factor * L) / (1.0 + abs(factor * L))


def _sizes(L: ComplexArray, skew: float, pair: bool) -> RealArray:
    """The least |delta| that breaks each of the loops L (F,)."""
    S, shift = 1.0 / (1.0 + L), (1.0 + skew) / 2.0
    own = shift - L * S
    if not pair:
        return 1.0 / np.abs(own)
    # The closed loop u = -y, y = L u, from signals added to (u, y) to (u, y) before the addition.
    closed = np.stack([np.stack([own, -S], -1), np.stack([L * S, own], -1)], -2)
    scale = np.sqrt(np.abs(L))  # makes both off-diagonal entries equal in size
    tried = scale[:, None] * np.geomspace(0.5, 2.0, 9)
    scaled = np.repeat(closed[:, None], 9, axis=1)
    scaled[..., 0, 1] *= tried
    scaled[..., 1, 0] /= np.maximum(tried, 1e-300)
    return 1.0 / np.linalg.norm(scaled, 2, axis=(-2, -1)).min(axis=1)


def _speed(system: Any) -> float:
    sizes = np.abs(np.linalg.eigvals(system.A)) if system.nstates else np.zeros(0)
    loop = np.linalg.norm(system.B) * np.linalg.norm(system.C) if system.nstates else 0.0
    return float(max(sizes.max(initial=0.0), loop)) or 1.0


def _frequencies(rho: float, delay: float) -> RealArray:
    """Frequencies from 0 on, close enough to resolve the turns of the dead time where the loop gain
    is not small.
    """
    points = np.geomspace(rho * 10.0**-DECADES, rho * 10.0**DECADES, POINTS)
    return np.concatenate([[0.0], points])


def _response(system: Any, s: Any) -> ComplexArray:
    n = system.nstates
    found: ComplexArray = np.full(s.shape, complex(system.D[0, 0]))
    if n:
        solved = np.linalg.solve(s[:, None, None] * np.eye(n) - system.A, system.B[None] + 0j)
        found = found + (system.C @ solved)[:, 0, 0]
    return found


def _closed(system: Any, omega: RealArray, delay: float, gain: float, rho: float) -> ComplexArray:
    """f(s) / (s + rho)^n at s = j omega."""
    s = 1j * omega
    late = gain * np.exp(-s * delay)
    n = system.nstates
    M = np.zeros((omega.size, n + 1, n + 1), complex)
    M[:, :n, :n] = (s[:, None, None] * np.eye(n) - system.A) / (s + rho)[:, None, None]
    M[:, :n, n] = -system.B[:, 0] / np.sqrt(s + rho)[:, None]
    M[:, n, :n] = late[:, None] * system.C[0] / np.sqrt(s + rho)[:, None]
    M[:, n, n] = 1.0 + late * system.D[0, 0]
    found: ComplexArray = np.linalg.det(M)
    return found
