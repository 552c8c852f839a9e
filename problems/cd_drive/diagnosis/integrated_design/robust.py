"""The least error that any filter can have at one frequency, for every plant of a set.

With y = S_delta (d + f), S_delta = S / (1 + T delta), and phi = F S, the weighted error is

    h(phi, delta) = |a (1 - phi s),  b phi s|,    s = 1 / (1 + T delta),

which is convex in phi. Its largest value over some delta is bounded from below by cuts, tangents at
points phi: a linear program in the plane.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from workbench.errors import SolverError
from workbench.types import ComplexArray, RealArray

SIDES = 48
"""Number of points tried on the boundary of the disc of uncertain gains, besides its centre."""
ROUNDS, GRID, SHRINK = 30, 17, 0.65
"""Number of rounds of the search in the plane, points on a side of the grid, and factor by which it
shrinks.
"""
SPAN = 1.5
"""Half the side of the first grid about 1/2."""


def least_robust(
    fault: float, disturbance: float, T: complex, spread: float
) -> tuple[float, float]:
    """Lower and upper bound on the least worst-case error over all phi.

    Parameters
    ----------
    fault, disturbance
        Weights a of the fault's error and b of what leaks of the disturbance.
    T
        Complementary sensitivity of the nominal loop.
    spread
        Largest |delta|, a relative error of the plant; only some of them are tried, so that the
        lower bound holds for all and the upper one for those.

    Raises SolverError where the linear program fails.
    """
    turns = np.exp(2j * np.pi * np.arange(SIDES) / SIDES)
    s = 1.0 / (1.0 + T * spread * np.append(turns, 0.0))
    centre, half = 0.5 + 0.0j, SPAN
    cuts: list[RealArray] = []
    best = np.inf
    for _ in range(ROUNDS):
        side = np.linspace(-half, half, GRID)
        points = (centre + side[:, None] + 1j * side[None, :]).ravel()
        values = worst_error(fault, disturbance, points, s)
        near = np.argsort(values)[:9]
        cuts += [_cut(fault, disturbance, complex(points[n]), s) for n in near]
        if values[near[0]] < best:
            best = float(values[near[0]])
        centre, half = complex(points[near[0]]), half * SHRINK
    return _bound(np.array(cuts)), best


def worst_error(fault: float, disturbance: float, phi: ComplexArray, s: ComplexArray) -> RealArray:
    """Largest weighted error (P,) of each phi over all s."""
    return np.sqrt(_errors(fault, disturbance, phi, s)).max(axis=1)


def _errors(fault: float, disturbance: float, phi: ComplexArray, s: ComplexArray) -> RealArray:
    passed = phi[:, None] * s[None, :]
    squares: RealArray = fault**2 * abs(1 - passed) ** 2 + disturbance**2 * abs(passed) ** 2
    return squares


def _cut(fault: float, disturbance: float, phi: complex, s: ComplexArray) -> RealArray:
    """(slope re, slope im, offset) of a tangent of the worst error at phi."""
    squares = _errors(fault, disturbance, np.array([phi]), s)[0]
    worst = s[int(squares.argmax())]
    value = float(np.sqrt(squares.max()))
    error = 1 - phi * worst
    slope = (
        -(fault**2) * error * worst.conjugate() + disturbance**2 * abs(worst) ** 2 * phi
    ) / value
    return np.array([slope.real, slope.imag, value - slope.real * phi.real - slope.imag * phi.imag])


def _bound(cuts: RealArray) -> float:
    """The minimum over the plane of the largest tangent."""
    scale = abs(cuts[:, 2]).max()
    rows = np.column_stack([cuts[:, :2], -np.full(len(cuts), scale)])
    free = [(None, None)] * 3
    found = linprog([0.0, 0.0, 1.0], A_ub=rows / scale, b_ub=-cuts[:, 2] / scale, bounds=free)
    if found.status:
        raise SolverError(f"the bound of the least robust error: {found.message}")
    return float(found.fun) * scale
