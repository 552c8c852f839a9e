"""Levels of H-infinity synthesis: whether there is a controller of norm gamma, and the least one.

K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 17.1, called ZDG here, for
plants with D12 = [0; I], D21 = [0 I] and D22 = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.systems.frequency_response import frequency_response
from workbench.systems.norms import norm
from workbench.systems.riccati import hamiltonian_solution
from workbench.systems.standard_plant import StandardPlant

SMALLEST = 1e-6
"""Least level looked for, relative to the norm of the mean-square controller: less is zero."""
CANCELLED, ZERO = 1e-13, 1e-7
"""Share of w -> z without K below which the norm of a loop is rounding, and a level for it."""
MIDDLE = np.exp(0.5j)
"""A point of middle frequency, off the axis, where poles may lie."""
LARGEST = 1e100
"""Largest level that is told from infinity."""
STEPS, CERTAIN = 80, 8
"""Levels tried, and after how many every other one halves the interval."""
PROBES = (0.65, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995, 0.998)
"""Shares of the level found that are tried once more."""


@dataclass(frozen=True, eq=False)
class Level:
    """X and Y of a level gamma, both positive semidefinite, with their gains F and L."""

    gamma: float
    X: RealArray
    Y: RealArray
    F: RealArray
    L: RealArray

    @cached_property
    def coupling(self) -> float:
        """rho(X Y) / gamma^2, below 1 where the level is feasible."""
        return _radius(self.X, self.Y) / self.gamma**2

    @property
    def feasible(self) -> bool:
        return self.coupling < 1.0


def least_level(plant: StandardPlant, tolerance: float) -> tuple[float, Level]:
    """A level below which there is no controller, and a feasible one close above it.

    Raises SolverError where none is found.
    """
    floor, ceiling = level_ends(plant)
    low, high = floor, ceiling
    best = level_at(plant, high)
    for _ in range(STEPS):
        if best is not None and best.feasible:
            break
        low, high = high, 2.0 * high
        best = level_at(plant, high)
    else:
        raise SolverError(f"no level up to gamma = {high:.3g} is feasible, numerically")
    low, best = _bisected(plant, low, best, tolerance)
    # Rounding hides slow modes, and so a feasible level, here and there.
    for share in PROBES:
        level = level_at(plant, share * best.gamma) if share * best.gamma > floor else None
        if level is not None and level.feasible:
            low, best = _bisected(plant, floor, level, tolerance)
    return low, best


def _bisected(
    plant: StandardPlant, low: float, best: Level, tolerance: float
) -> tuple[float, Level]:
    """A level where no controller was found, and a feasible one close above it."""
    below: Level | None = None
    step = 0
    while best.gamma > (1.0 + tolerance) * low and step < STEPS:
        trial = _between(low, below, best, tolerance, step)
        level = level_at(plant, trial)
        if level is not None and level.feasible:
            best = level
        else:
            low, below = trial, level
        step += 1
    return low, best


def _between(low: float, below: Level | None, best: Level, tolerance: float, step: int) -> float:
    """The next level: where the coupling is 1 by interpolation, or the middle."""
    high = best.gamma
    middle = math.sqrt(low * high)
    if below is None or best.coupling <= 0.0 or (step > CERTAIN and step % 2):
        return middle
    # The inverse of the coupling is nearly linear in gamma.
    a, b = 1.0 / below.coupling - 1.0, 1.0 / best.coupling - 1.0
    root = low - (high - low) * a / (b - a)
    inside = 1.0 + tolerance / 4
    return min(max(root, low * inside), high / inside)


def level_ends(plant: StandardPlant) -> tuple[float, float]:
    """A level below the least one, and the norm of the loop of gamma = infinity to start from.

    No level is below the norms of the direct term that K cannot reach (Parrott), nor below the
    coupling of X and Y at infinity, which they only exceed.
    """
    m, p = plant.controls, plant.measurements
    state, estimate = _state_feedback(plant, math.inf), _state_feedback(plant.dual, math.inf)
    if state is None or estimate is None:
        where = (
            "(A, B2, C1, D12), of control," if state is None else "(A, B1, C2, D21), of estimation,"
        )
        more = "the weight on u" if state is None else "the noise on y"
        raise SolverError(
            f"the Riccati equation of {where} has no stabilising solution for gamma = infinity, "
            "numerically: an assumption fails or nearly does (see synthesis.assumptions); move "
            f"slow poles and zeros off the imaginary axis, or add to {more} (regularised() does)"
        )
    (X, F), (Y, L) = state, estimate
    D11 = plant.D11
    direct = -D11[len(D11) - m :, D11.shape[1] - p :]
    # The mean-square controller, its direct term free to cancel that of w -> z.
    F2, L2 = F[D11.shape[1] :], L[len(D11) :].T
    Bk = plant.B2 @ direct - L2
    K = (plant.A + plant.B2 @ F2 - Bk @ plant.C2, Bk, F2 - direct @ plant.C2, direct)
    least = max(
        np.linalg.norm(D11[: len(D11) - m], 2) if len(D11) > m else 0.0,
        np.linalg.norm(D11[:, : D11.shape[1] - p], 2) if D11.shape[1] > p else 0.0,
        math.sqrt(_radius(X, Y)),
    )
    try:
        ceiling = 1.01 * norm(plant.close(K), 1e-3)
    except ArithmeticError:  # SLICOT did not converge
        ceiling = math.inf
    if not 0.0 < ceiling < math.inf:  # only a first level to try: whence does not matter
        ceiling = 2.0 * float(least) or 1.0
    size = without_control(plant)
    if ceiling < CANCELLED * size:  # K cancels w -> z; any level that counts as zero will do
        return ZERO * size, ZERO * size
    return max(float(least), SMALLEST * ceiling), ceiling


def without_control(plant: StandardPlant) -> float:
    """The size of w -> z without K at high and at middle frequencies."""
    M = np.block([[plant.A, plant.B1], [plant.C1, plant.D11]])
    middle = frequency_response(M, plant.states, MIDDLE)
    return float(max(np.linalg.norm(plant.D11), np.linalg.norm(middle)))


def level_at(plant: StandardPlant, gamma: float) -> Level | None:
    """None where a Riccati equation has no positive semidefinite stabilising solution."""
    state = _state_feedback(plant, gamma)
    if state is None:
        return None
    estimate = _state_feedback(plant.dual, gamma)
    if estimate is None:
        return None
    return Level(gamma, state[0], estimate[0], state[1], estimate[1].T)


def _state_feedback(plant: StandardPlant, gamma: float) -> tuple[RealArray, RealArray] | None:
    """X and F = -R^-1 (D1^T C1 + B^T X), R = D1^T D1 - diag(gamma^2 I, 0) (ZDG eq. 17.1 to 17.4).

    u takes the last performance outputs to zero and adds v, so that they are v; what is left has
    no cancellation. None where X >= 0 does not exist, or gamma is below the norm of what is left.
    """
    split = len(plant.D11) - plant.controls
    C, D = plant.C1[:split], plant.D11[:split]
    C_u, D_u = plant.C1[split:], plant.D11[split:]
    A, B = plant.A - plant.B2 @ C_u, plant.B1 - plant.B2 @ D_u
    shrink = 1.0 / gamma / gamma  # 0 at infinity
    left = np.eye(D.shape[1]) - shrink * D.T @ D
    if not np.linalg.eigvalsh(left)[0] > 0.0:
        return None
    # w = across x + back X x is the worst, v = -B2^T X x the best.
    across, back = shrink * np.linalg.solve(left, D.T @ C), shrink * np.linalg.solve(left, B.T)
    corner = A + B @ across
    Q = C.T @ (C + D @ across)
    X = hamiltonian_solution(
        np.block([[corner, B @ back - plant.B2 @ plant.B2.T], [-(Q + Q.T) / 2, -corner.T]])
    )
    if X is None:
        return None
    F1 = across + back @ X
    return X, np.vstack([F1, -plant.B2.T @ X - C_u - D_u @ F1])


def _radius(X: RealArray, Y: RealArray) -> float:
    return float(np.abs(np.linalg.eigvals(X @ Y)).max()) if len(X) else 0.0
