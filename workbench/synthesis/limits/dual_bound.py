"""A level of mu that no controller reaches, because T = L / (1 + L) must be stable: by duality.

Let the nominal plant be stable. Then K stabilises the loop only with T stable, which falls as the
plant does, with 1 / omega^2 at least. By Cauchy's theorem, for every h with real coefficients that
is analytic in the right half-plane and falls with 1 / omega,

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
from workbench.errors import InputError, SolverError
from workbench.executor import Context
from workbench.solvers import Options, conic_solvers, solve_conic
from workbench.synthesis.limits.allowed_sets import AllowedSets

COARSE, FINE = 300, 1000
"""Parts of the frequency range on which h is found, and on which it is judged."""
BISECTION_LEVELS = 8
"""Number of levels of mu tried by bisection."""
SOLVER_ACCURACY = 1e-5
"""Accuracy asked of the solver. Any h that proves the level will do."""

SetsAt = Callable[[RealArray, float], AllowedSets]
"""The sets of T at frequencies [rad/s] (F,) with mu at most a level."""


@dataclass(frozen=True, eq=False)
class AnalyticBasis:
    """Functions analytic in the right half-plane, of which h is a sum.

    Parameters
    ----------
    corners
        Magnitudes [rad/s] (N,) of the functions' real poles, positive; they should cover the
        frequencies where T falls off.
    band
        Frequencies [Hz] between which integrals are taken. Below it T and h must be nearly
        constant, and above it T h must fall with 1 / omega^3.
    """

    corners: RealArray
    band: tuple[float, float]

    def __post_init__(self) -> None:
        corners = np.atleast_1d(np.asarray(self.corners, dtype=float))
        if not corners.size or not (np.isfinite(corners) & (corners > 0.0)).all():
            raise InputError("corners must be positive frequencies [rad/s], one at least")
        low, high = self.band
        if not 0.0 < low < high < np.inf:
            raise InputError(f"band is {self.band}; it must be two frequencies [Hz], low and high")
        object.__setattr__(self, "corners", corners)

    def midpoints(self, parts: int) -> tuple[RealArray, RealArray]:
        """Frequencies [rad/s] (F,) in the middle of parts of the band, and the parts' widths.

        The parts are of equal length in log omega.
        """
        ends = 2 * np.pi * np.geomspace(*self.band, parts + 1)
        omega = np.sqrt(ends[1:] * ends[:-1])
        return omega, omega * np.log(ends[1:] / ends[:-1])

    def response(self, omega: RealArray) -> ComplexArray:
        """The functions at frequencies [rad/s] (F,): (F, N)."""
        s = 1j * omega[:, None]
        corners = self.corners
        passed = np.cumprod((s - corners[:-1]) / (s + corners[:-1]), axis=1)
        before = np.concatenate([np.ones((len(omega), 1)), passed], axis=1)
        found: ComplexArray = 2 * corners / (s + corners) * before
        return found


@dataclass(frozen=True, eq=False)
class DualCertificate:
    """An h that shows that no controller has mu at or below ``level`` at every frequency.

    ``coefficients`` (N,) are those of h in ``basis``. It proves the level where `integral` is
    negative.
    """

    level: float
    coefficients: RealArray
    basis: AnalyticBasis

    def h(self, omega: RealArray) -> ComplexArray:
        """At frequencies [rad/s] (F,)."""
        found: ComplexArray = self.basis.response(omega) @ self.coefficients
        return found

    def integral(self, sets: SetsAt, parts: int) -> float:
        """Integral of the largest Re(T h) over the band; minus infinity for an empty set.

        parts: how many the band is divided into.
        """
        omega, width = self.basis.midpoints(parts)
        at = sets(omega, self.level)
        if at.empty:
            return -np.inf
        h = self.h(omega)
        # Below the range T and h are nearly constant, above it T h falls with 1 / omega^3.
        farthest = (np.abs(at.circle.center) + at.circle.radius) * np.abs(h) * omega
        return float(width @ at.support(h) + 2 * (farthest[0] + farthest[-1]))


def highest_proven(
    sets: SetsAt, basis: AnalyticBasis, low: float, high: float, context: Context
) -> DualCertificate | None:
    """The highest level between two for which a certificate was found; None without one.

    The integral of a certificate is negative by more than it changes from COARSE to FINE parts.

    Parameters
    ----------
    sets
        The T that a level allows, such as `allowed_polygons` of the loop's weights.
    low, high
        Levels, positive, between which it is looked for.

    Raises
    ------
    SolverError
        The solver gives no answer for a level.
    """
    best = None
    for _ in range(BISECTION_LEVELS):
        level = float(np.sqrt(low * high))
        found = _candidate(sets, basis, level, context)
        fine, coarse = (found.integral(sets, parts) for parts in (FINE, COARSE))
        if fine + abs(fine - coarse) < 0.0:
            best, low = found, level
        else:
            high = level
    return best


def _candidate(
    sets: SetsAt, basis: AnalyticBasis, level: float, context: Context
) -> DualCertificate:
    """H of least integral of Re(c h), that of R |h| being 1, with circles around the sets.

    Raises SolverError where the solver gives none.
    """
    import cvxpy as cp

    omega, width = basis.midpoints(COARSE)
    circle = sets(omega, level).circle
    h = basis.response(omega)
    x = cp.Variable(len(basis.corners))
    along = (width * circle.center) @ h
    around = (width * circle.radius)[:, None] * h
    sizes = cp.norm(cp.vstack([around.real @ x, around.imag @ x]), 2, axis=0)
    problem = cp.Problem(cp.Minimize(along.real @ x), [cp.sum(sizes) <= 1])
    outcome, said = solve_conic(problem, conic_solvers()[0], Options(SOLVER_ACCURACY), context)
    if x.value is None:
        raise SolverError(f"no h for the level {level:.6g}: {outcome}, {said}")
    return DualCertificate(level, np.asarray(x.value, dtype=float), basis)
