"""The least worst error near a start, by a primal-dual interior-point method.

With the errors e_i in units of the worst one at the start, it minimises t over the parameters
subject to |e_i|^2 + s_i = t and s_i >= 0. Newton's method solves the conditions of an optimum:
multipliers z_i >= 0 have the sum 1, and the products s_i z_i equal a small mu, which falls as in
Mehrotra's predictor-corrector method (SIAM J. Optimization 2, 1992). Second derivatives are exact.
A step is taken if it lowers the barrier function t - mu sum(log s) or the violation of the
constraints, as in the filter of Waechter and Biegler (Mathematical Programming 106, 2006).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from workbench._core.arrays import EPS, RealArray
from workbench.fitting.response.fit_state import FitState

MAX_STEPS = 60
"""Largest number of steps; about twenty are usual."""
GAP_END = 1e-4
"""The search ends when the sum of the products s z, the violation and the predicted decrease, each
relative to t, are below this.
"""
STARTING_HEIGHT = 1.1
"""t at the start and at each restart, relative to the largest |e|^2."""
MAX_RESTARTS = 2
"""Largest number of restarts from the best point; a restart follows if no part of a step is
accepted.
"""
LARGEST_STEP = 3.0
"""Largest change of a parameter in one step, in its natural unit."""
BOUNDARY_SHARE = 0.99
"""Largest share of the way to the boundary s = 0 or z = 0 that a step covers."""
LEAST_CENTERING = 0.1
"""Smallest ratio of mu to the mean product s z."""
LEAST_MULTIPLIER = 0.01
"""Smallest multiplier relative to mu / s; smaller ones would let steps end at the boundary."""
HALVINGS = 8
"""Largest number of shares of a step that are tried, each half of the one before."""
LARGEST_VIOLATION = 1.0
"""Largest violation of a constraint that a step may cause, in the units of t."""
STEP_COST = 1e-3
"""Curvature that is added for each parameter in its natural unit, relative to the sum of the
products s z: parameters that hardly matter then stay where they are.
"""
FIRST_DAMPING, LARGEST_DAMPING = 1e-6, 1e12
"""First and largest damping of a matrix that is not positive definite, relative to its diagonal."""
CONVEX_DAMPING = 1e-3
"""Largest damping at an optimum."""


@dataclass(frozen=True)
class _Iterate:
    """A point with t, slacks s (F,) and multipliers z (F,); ``unit`` is the unit of its errors."""

    point: FitState
    unit: float
    height: float
    slack: RealArray
    multiplier: RealArray

    @classmethod
    def inside(cls, point: FitState, unit: float) -> _Iterate:
        """A point with slacks that meet the constraints."""
        square = _squares(point, unit)
        height = STARTING_HEIGHT * float(square.max())
        slack = height - square
        return cls(point, unit, height, slack, 1 / slack / np.sum(1 / slack))

    @cached_property
    def products(self) -> float:
        """Sum of the products s z; in a convex program it bounds the distance of t from its
        optimum.
        """
        return float(self.multiplier @ self.slack)

    @cached_property
    def excess(self) -> RealArray:
        """Violations (F,) of the constraints, positive where t is too small."""
        excess: RealArray = _squares(self.point, self.unit) + self.slack - self.height
        return excess

    def barrier(self, mu: float) -> float:
        """Value of the barrier function."""
        return float(self.height - mu * np.log(self.slack).sum())


@dataclass(frozen=True)
class _Step:
    """Changes of the parameters (P,), t, the slacks (F,) and the multipliers (F,) for a ``mu``."""

    mu: float
    vector: RealArray
    height: float
    slack: RealArray
    multiplier: RealArray

    def reach(self, here: _Iterate) -> tuple[float, float]:
        """Shares of the step after which the first slack, and the first multiplier, becomes
        zero.
        """
        primal = float((-self.slack / here.slack).max())
        dual = float((-self.multiplier / here.multiplier).max())
        return 1 / max(primal, EPS), 1 / max(dual, EPS)

    def slope(self, here: _Iterate) -> float:
        """Derivative of the barrier function along the step."""
        return float(self.height - self.mu * (self.slack / here.slack).sum())


class _System:
    """Newton's equations at an iterate, reduced to the parameters and t."""

    def __init__(self, here: _Iterate, damping: float) -> None:
        """``damping`` is the damping of the last system; the attribute `damping` is infinite if no
        damping suffices.
        """
        point, z = here.point, here.multiplier
        slopes, error = point.slopes / here.unit, point.error / here.unit
        real, count = np.concatenate([slopes.real, slopes.imag]), slopes.shape[1]
        self.here, self.excess, self.ratio = here, here.excess, z / here.slack
        self.slopes = 2 * (error.conj()[:, None] * slopes).real  # the derivatives of |e|^2
        steep = self.slopes * self.ratio[:, None]
        convex = 2 * (real.T * np.concatenate([z, z])) @ real + steep.T @ self.slopes
        curved = point.curvature(2 * z * error.conj() / here.unit)
        self.natural = point.natural_units
        cost = STEP_COST * min(here.products, 1.0) / self.natural**2
        matrix = np.empty((count + 1, count + 1))
        matrix[:count, :count] = convex + curved
        matrix[np.arange(count), np.arange(count)] += cost
        matrix[count, :count] = matrix[:count, count] = -steep.sum(axis=0)
        matrix[count, count] = total = self.ratio.sum()
        self.size = np.sqrt(np.append(convex.diagonal() + abs(curved.diagonal()) + cost, total))
        matrix /= self.size * self.size[:, None]
        self.damping = damping / 10 if damping > FIRST_DAMPING else 0.0
        while True:
            damped = matrix + (self.damping + 1e6 * EPS) * np.eye(self.size.size)
            self.factor, failed = dpotrf(damped)
            if not failed:
                break
            self.damping = max(FIRST_DAMPING, 5 * self.damping)
            if not self.damping < LARGEST_DAMPING:
                self.damping = np.inf
                break

    def step(self, mu: float) -> _Step:
        """The step towards products s z of size mu."""
        pull = mu / self.here.slack + self.ratio * self.excess
        right = np.append(-(pull @ self.slopes), pull.sum() - 1)
        found = dpotrs(self.factor, right / self.size)[0] / self.size
        vector, height = found[:-1], float(found[-1])
        slack = height - self.excess - self.slopes @ vector
        multiplier = mu / self.here.slack - self.here.multiplier - self.ratio * slack
        return _Step(mu, vector, height, slack, multiplier)


def _squares(point: FitState, unit: float) -> RealArray:
    """Squares |e|^2 (F,) of the errors in a unit."""
    scaled = point.error / unit
    squares: RealArray = scaled.real**2 + scaled.imag**2
    return squares


def least_peak(start: FitState) -> FitState:
    """The point of the smallest worst error on the way from a start to a local optimum."""
    with np.errstate(all="ignore"):  # a step that overflows is refused
        best, here = start, _Iterate.inside(start, start.peak)
        damping, restarts = 0.0, 0
        for _ in range(MAX_STEPS):
            system = _System(here, damping)
            damping = system.damping
            if not np.isfinite(damping):
                break
            step = system.step(_centered(here, system.step(0.0)))
            moved = _moved(here, step, system.natural)
            if moved is None and restarts < MAX_RESTARTS:
                restarts += 1
                here = _Iterate.inside(best, start.peak)
                damping = max(10 * damping, CONVEX_DAMPING)
                continue
            if moved is None:
                break
            slope, here = step.slope(here), moved
            best = min(best, here.point, key=lambda point: point.peak)
            end = GAP_END * here.height
            left = max(here.products, abs(slope), float(here.excess.max()))
            if left <= end and damping <= CONVEX_DAMPING:
                break
        return best


def _centered(here: _Iterate, towards_zero: _Step) -> float:
    """The next mu: small where a step towards mu = 0 makes the products s z small."""
    primal, dual = (min(share, 1.0) for share in towards_zero.reach(here))
    slack = here.slack + primal * towards_zero.slack
    left = float(slack @ (here.multiplier + dual * towards_zero.multiplier)) / here.products
    return min(max(left**3, LEAST_CENTERING), 1.0) * here.products / here.slack.size


def _moved(here: _Iterate, step: _Step, natural: RealArray) -> _Iterate | None:
    """The iterate after the largest acceptable share of a step; None if there is none."""
    primal, dual = (min(1.0, BOUNDARY_SHARE * share) for share in step.reach(here))
    share = min(primal, LARGEST_STEP / max(float(np.abs(step.vector / natural).max()), EPS))
    violation, barrier = here.excess.max(initial=0.0), here.barrier(step.mu)
    multiplier = here.multiplier + dual * step.multiplier
    for _ in range(HALVINGS):
        point = here.point.moved(share * step.vector)
        if np.isfinite(point.peak):
            height = here.height + share * step.height
            square = _squares(point, here.unit)
            slack = np.maximum(here.slack + share * step.slack, height - square)
            least = LEAST_MULTIPLIER * step.mu / slack
            moved = _Iterate(point, here.unit, height, slack, np.maximum(multiplier, least))
            now = moved.excess.max(initial=0.0)
            fallen = barrier - moved.barrier(step.mu)
            wanted = 1e-5 * violation + 1e-4 * share * max(-step.slope(here), 0.0)
            if now <= LARGEST_VIOLATION and (now <= 0.999 * violation or fallen >= wanted):
                return moved
        share /= 2
    return None
