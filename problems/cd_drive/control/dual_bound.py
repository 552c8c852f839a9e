"""A level of mu that no controller reaches, because T = L / (1 + L) must be stable: by duality.

The nominal plant of a drive is stable, so that K stabilises the loop only with T stable and, as
the plant, falling with 1 / omega^2 at least. Then by Cauchy's theorem, for every h with real
coefficients that is analytic in the right half-plane and falls with 1 / omega,

    integral over omega from 0 to infinity of Re(T(j omega) h(j omega)) = 0.

Where mu is at most a level, T(j omega) lies in a set. If the integral of the largest Re(T h) in
those sets is negative for one h, no controller reaches the level: h proves it, whatever it came
from. Here it comes from a cone program, with circles around the sets in their place. It is the
dual of H-infinity synthesis, and for sets that are not discs a bound that is not far from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.solvers import Options, conic_solvers, solve_conic

from .allowed_sets import Sets

LOWEST, HIGHEST = 1e-3, 1e7
"""Frequencies [Hz] that integrals are taken between."""
COARSE, FINE = 300, 1000
"""Parts of that range for h to be found, and to be judged."""
POLES = 2 * np.pi * np.geomspace(30.0, 3e5, 24)
"""Of h, negative [rad/s]."""
STEPS = 8
"""Levels tried."""
ACCURACY = 1e-5
"""Asked of the solver: any h will do that proves the level."""


@dataclass(frozen=True)
class Proof:
    """No K has mu at or below ``level`` everywhere: ``coefficients`` (N,) of h in `basis`."""

    level: float
    coefficients: RealArray

    def h(self, omega: RealArray) -> ComplexArray:
        """At frequencies [rad/s] (F,)."""
        found: ComplexArray = basis(omega) @ self.coefficients
        return found

    def integral(self, sets: SetsAt, parts: int) -> float:
        """Of the largest Re(T h), negative where the proof holds; infinite for an empty set."""
        omega, width = midpoints(parts)
        at = sets(omega, self.level)
        if at.empty:
            return -np.inf
        h = self.h(omega)
        # Below the range T and h are nearly constant, above it T h falls with 1 / omega^3.
        farthest = (np.abs(at.circle.center) + at.circle.radius) * np.abs(h) * omega
        return float(width @ at.support(h) + 2 * (farthest[0] + farthest[-1]))


SetsAt = Callable[[RealArray, float], Sets]
"""The sets of T at frequencies [rad/s] (F,) with mu at most a level."""


def highest_proven(sets: SetsAt, low: float, high: float, context: Context) -> Proof | None:
    """The highest level between two with a proof that was found; None without one.

    A proof holds by more than its integral changes from COARSE to FINE parts.
    """
    best = None
    for _ in range(STEPS):
        level = float(np.sqrt(low * high))
        proof = _proof(sets, level, context)
        fine, coarse = (proof.integral(sets, parts) for parts in (FINE, COARSE))
        if fine + abs(fine - coarse) < 0.0:
            best, low = proof, level
        else:
            high = level
    return best


def _proof(sets: SetsAt, level: float, context: Context) -> Proof:
    """H of least integral of Re(c h), that of R |h| being 1, with circles around the sets.

    Raises SolverError where the solver gives none.
    """
    import cvxpy as cp

    omega, width = midpoints(COARSE)
    circle = sets(omega, level).circle
    h = basis(omega)
    x = cp.Variable(len(POLES))
    along = (width * circle.center) @ h
    around = (width * circle.radius)[:, None] * h
    sizes = cp.norm(cp.vstack([around.real @ x, around.imag @ x]), 2, axis=0)
    problem = cp.Problem(cp.Minimize(along.real @ x), [cp.sum(sizes) <= 1])
    outcome, said = solve_conic(problem, conic_solvers()[0], Options(ACCURACY), context)
    if x.value is None:
        raise SolverError(f"no h for the level {level:.6g}: {outcome}, {said}")
    return Proof(level, np.asarray(x.value, dtype=float))


def midpoints(parts: int) -> tuple[RealArray, RealArray]:
    """Frequencies [rad/s] (F,) in the middle of parts of the range, in log omega, and widths."""
    ends = 2 * np.pi * np.geomspace(LOWEST, HIGHEST, parts + 1)
    omega = np.sqrt(ends[1:] * ends[:-1])
    return omega, omega * np.log(ends[1:] / ends[:-1])


def basis(omega: RealArray) -> ComplexArray:
    """Functions (F, N) analytic in the right half-plane, of `POLES`; h is a sum of them."""
    s = 1j * omega[:, None]
    passed = np.cumprod((s - POLES[:-1]) / (s + POLES[:-1]), axis=1)
    before = np.concatenate([np.ones((len(omega), 1)), passed], axis=1)
    found: ComplexArray = 2 * POLES / (s + POLES) * before
    return found
