"""Dwell times by descent over factors of the quadratic functions, without a conic solver.

With P_i = R_i' R_i every inequality A' P_j A < P_i says that the norm of R_j A R_i^-1 is below 1.
The largest logarithm of these norms is not convex in R. It becomes smooth, with a gradient in
closed form, when a p-norm replaces the maximum over singular values and inequalities. (Factors in
place of positive definite matrices: S. Burer, R. Monteiro, Mathematical Programming 95 (2003)
329-357.)
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.program import Claim, method
from workbench.solvers import Outcome
from workbench.synthesis.switching.dwell_search import (
    MOST_CUTS,
    added_stays,
    congruent,
    coordinates,
    first_stays,
    shortest_proven,
    symmetric,
)
from workbench.synthesis.switching.program import FALL_MARGIN, Dwell, SwitchedStability

NORM_POWERS = (4, 16, 64, 256, 1024)
"""Powers p of the p-norms that replace the maximum, used one after the other."""
MOST_STEPS = 400
"""Largest number of quasi-Newton steps with each power."""
ENOUGH = -1e-6
"""The descent ends when the largest logarithm is at most this: all inequalities then hold."""
LEAST_DECAY = 1e-9
"""Least unit by which the logarithms of a decay inequality are divided."""


class Inequalities(NamedTuple):
    """Inequalities |R_next A R_own^-1| < 1: A (K, n, n), modes (K,), units of the logarithms
    (K,).
    """

    A: RealArray
    own: np.ndarray
    next: np.ndarray
    unit: RealArray


class _EnoughError(Exception):
    """All inequalities hold at these parameters."""

    def __init__(self, vector: RealArray) -> None:
        super().__init__()
        self.vector = vector


@method(SwitchedStability, "descent", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _descent(program: SwitchedStability, context: Context) -> Claim:
    """Bisection over the dwell time; quasi-Newton steps on a p-norm of all ratios give P.

    The problem in the factors is not convex. So the descent may miss a dwell time, but it never
    proves a wrong one.
    """
    L = coordinates(program)

    def proven(samples: int) -> Dwell | None:
        stays = [first_stays(program.stays(mode, samples)) for mode in program.modes]
        R = np.stack([np.eye(program.states)] * len(program.modes))
        for _ in range(MOST_CUTS):
            R, worst = _minimised_ratio(_inequalities(program, stays, L), R)
            if worst >= 0.0:
                return None
            found = Dwell(samples, np.stack([symmetric(L @ (Q.T @ Q) @ L.T) for Q in R]))
            if all(check.holds for check in program.checks(found, FALL_MARGIN)):
                return found
            ratios = [program.ratios(found, i)[0] for i in range(len(program.modes))]
            if not added_stays(program, samples, stays, ratios):
                return None
        return None

    best = shortest_proven(program, proven, context)
    if best is None:
        said = f"the descent proves no dwell up to {program.limit_samples} samples"
        return None, Outcome.FAILED, said
    unstable, which = program.destabilising
    missed = f"the descent proves no dwell of {best.samples - 1} samples"
    return best, Outcome.SOLVED, which if best.samples == unstable + 1 else missed


def _inequalities(program: SwitchedStability, stays: list[list[int]], L: RealArray) -> Inequalities:
    """The inequalities for some stays of each mode, in coordinates L' x.

    Each logarithm is divided by a unit. For the decay of a mode over one sample the unit is the
    decay of its spectral radius, which no P can exceed. For the step to the next mode it is 1.
    """
    A, own, after, unit = [], [], [], []
    for i, mode in enumerate(program.modes):
        found = [(one, j, 1.0) for stay in stays[i] for one in congruent(mode.over(stay), L)
                 for j in range(len(program.modes)) if j != i]  # fmt: skip
        if mode.longest_samples is None:
            rates = mode.radius / (mode.rate or 1.0)
            for one, rate in zip(congruent(mode.decaying, L), rates, strict=True):
                decay = -2.0 * math.log(max(float(rate), np.finfo(float).tiny))
                found.append((one, i, min(max(decay, LEAST_DECAY), 1.0)))
        for one, j, size in found:
            A.append(one)
            own.append(i)
            after.append(j)
            unit.append(size)
    return Inequalities(np.stack(A), np.array(own), np.array(after), np.array(unit))


def _minimised_ratio(held: Inequalities, R: RealArray) -> tuple[RealArray, float]:
    """Upper triangular factors (modes, n, n) after the descent, and the largest logarithm of a
    ratio.
    """
    from scipy.optimize import minimize

    rows, columns = np.triu_indices(R.shape[1])
    shape = R.shape

    def factors(vector: RealArray) -> RealArray:
        found = np.zeros(shape)
        found[:, rows, columns] = vector.reshape(shape[0], -1)
        return found

    def cost(vector: RealArray, power: int) -> tuple[float, RealArray]:
        try:
            value, gradient, worst = _p_norm(held, factors(vector), power)
        except np.linalg.LinAlgError:
            return math.inf, np.zeros_like(vector)
        if worst <= ENOUGH:
            raise _EnoughError(vector)
        return value, gradient[:, rows, columns].ravel()

    vector = R[:, rows, columns].ravel()
    try:
        for power in NORM_POWERS:
            found = minimize(cost, vector, (power,), "BFGS", jac=True,
                             options={"maxiter": MOST_STEPS})  # fmt: skip
            vector = found.x
    except _EnoughError as enough:
        vector = enough.vector
    return factors(vector), _p_norm(held, factors(vector), NORM_POWERS[-1])[2]


def _p_norm(held: Inequalities, R: RealArray, power: int) -> tuple[float, RealArray, float]:
    """Logarithm of the p-norm of all ratios, its gradient (modes, n, n), and the largest
    logarithm.
    """
    inverse = np.linalg.inv(R)
    right = held.A @ inverse[held.own]
    X = R[held.next] @ right
    left, sizes, rows = np.linalg.svd(X)
    levels = 2.0 * np.log(np.maximum(sizes, np.finfo(float).tiny)) / held.unit[:, None]
    worst = float(levels.max())
    share = np.exp(power * (levels - worst))
    total = share.sum()
    slope = 2.0 * share / total / held.unit[:, None] / np.maximum(sizes, np.finfo(float).tiny)
    towards = (left * slope[:, None, :]) @ rows  # derivative by the entries of X
    gradient = np.zeros_like(R)
    np.add.at(gradient, held.next, towards @ right.mT)
    np.add.at(gradient, held.own, -X.mT @ towards @ inverse[held.own].mT)
    return worst + float(np.log(total)) / power, gradient, worst
