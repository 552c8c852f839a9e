"""H-infinity synthesis by two Riccati equations, fast enough to stand inside an iteration.

K. Glover, J. Doyle, State-space formulae for all stabilizing controllers that satisfy an
H-infinity norm bound, Systems and Control Letters 11 (1988) 167-172; K. Zhou, J. Doyle, K. Glover,
Robust and Optimal Control (1996), theorem 17.1, called ZDG here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, matrix_balance, schur

from workbench.errors import SolverError
from workbench.synthesis.norm import norm
from workbench.synthesis.scaling import EPS, Scaled, scaled
from workbench.synthesis.standard import Matrices, Real, StandardPlant

ASYMMETRY = 1e-4
"""Of X1^T X2, relative: rounding errors make less, eigenvalues on the axis make it near 1."""
INDEFINITE = 1e-7
"""Negative eigenvalues of X and Y, relative to the largest, that are rounding errors."""
NEAR_AXIS = 10.0
"""Multiple of the rounding error of a Hamiltonian up to which an eigenvalue is imaginary."""
SMALLEST = 1e-9
"""Least level looked for, relative to the norm that the best controller in the mean square has."""
STEPS = 80
"""Levels tried."""
BACK_OFF = (1.0, 3.0, 10.0, 30.0, 100.0)
"""Multiples of the tolerance by which the level is raised until the loop is what it should be."""
EXCESS = 1e-6
"""By which the norm of the loop may exceed the level, relative, for rounding."""


class Central(NamedTuple):
    """A controller (A, B, C, D) whose loop has ``norm``, at most its level ``gamma``.

    No level below ``lower`` has one, by the Riccati equations.
    """

    K: Matrices
    gamma: float
    lower: float
    norm: float


class InfeasibleError(SolverError):
    """No controller has the level asked for, nor one below ``lower``."""

    def __init__(self, gamma: float, lower: float) -> None:
        super().__init__(
            f"no stabilising controller has a norm below gamma = {gamma:.6g}; the least level lies "
            f"above {lower:.6g}"
        )
        self.lower = lower


def central(
    A: Real,
    B: Real,
    C: Real,
    D: Real,
    controls: int,
    measurements: int,
    tolerance: float = 1e-3,
    gamma: float | None = None,
) -> Central:
    """The central controller of a continuous-time plant, u = K y with positive feedback.

    Parameters
    ----------
    A, B, C, D
        The plant's, the controls last of the inputs, the measurements last of the outputs.
    tolerance
        Relative width of the interval in which the least level is found. The controller is made
        for a level above by as much again, since one at the least level has poles at infinity.
    gamma
        The level asked for; None: the least.

    Raises
    ------
    InputError
        D12 or D21 without full rank, an unstable hidden mode.
    InfeasibleError
        No controller has the level asked for.
    SolverError
        No level is feasible, or no controller made holds its level.
    """
    plant = StandardPlant(A, B, C, D, controls, measurements)
    return central_of(scaled(plant), tolerance, gamma)


def central_of(normal: Scaled, tolerance: float, gamma: float | None = None) -> Central:
    """`central` of a plant that has been scaled."""
    plant = normal.plant
    if gamma is None:
        low, best = least_level(plant, tolerance)
        return _made(normal, (best.gamma * (1.0 + tolerance * k) for k in BACK_OFF), low)
    level = _level(plant, gamma)
    if level is None or not level.feasible:
        raise InfeasibleError(gamma, least_level(plant, tolerance)[0])
    return _made(normal, [gamma], 0.0)


# --- the level --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Level:
    """X and Y of a level gamma, both positive semidefinite, with their gains F and L."""

    gamma: float
    X: Real
    Y: Real
    F: Real
    L: Real

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
    low, below = floor, None
    high = ceiling
    best = _level(plant, high)
    for _ in range(STEPS):
        if best is not None and best.feasible:
            break
        low, high = high, 2.0 * high
        best = _level(plant, high)
    else:
        raise SolverError(f"no level up to gamma = {high:.3g} is feasible, numerically")
    step = 0
    while best.gamma > (1.0 + tolerance) * low and step < STEPS:
        trial = _between(low, below, best, tolerance, step)
        level = _level(plant, trial)
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
    if below is None or step % 3 == 2 or best.coupling <= 0.0:
        return middle
    a, b = math.log(below.coupling), math.log(best.coupling)
    root = low * (high / low) ** (a / (a - b))
    inside = 1.0 + tolerance / 4
    return min(max(root, low * inside), high / inside)


def level_ends(plant: StandardPlant) -> tuple[float, float]:
    """A level below the least one, and the norm of the loop of gamma = infinity.

    No level is below the norms of the direct term that K cannot reach (Parrott), nor below the
    coupling of X and Y at infinity, which they only exceed.
    """
    m, p = plant.controls, plant.measurements
    state, estimate = _state_feedback(plant, math.inf), _state_feedback(plant.dual, math.inf)
    if state is None or estimate is None:
        raise SolverError(
            "the Riccati equation of gamma = infinity has no stabilising solution: an assumption "
            "does not hold, numerically; see workbench.synthesis.assumptions"
        )
    (X, F), (Y, L) = state, estimate
    D11 = plant.D11
    direct = -D11[len(D11) - m :, D11.shape[1] - p :]
    # The mean-square controller, its direct term free to cancel that of w -> z.
    F2, L2 = F[D11.shape[1] :], L[len(D11) :].T
    Bk = plant.B2 @ direct - L2
    K = (plant.A + plant.B2 @ F2 - Bk @ plant.C2, Bk, F2 - direct @ plant.C2, direct)
    ceiling = norm(plant.close(K), 1e-3)
    least = max(
        np.linalg.norm(D11[: len(D11) - m], 2) if len(D11) > m else 0.0,
        np.linalg.norm(D11[:, : D11.shape[1] - p], 2) if D11.shape[1] > p else 0.0,
        math.sqrt(_radius(X, Y)),
    )
    if not math.isfinite(ceiling):
        raise SolverError("the controller of gamma = infinity does not stabilise, numerically")
    ceiling = max(ceiling, np.finfo(float).tiny ** 0.25) * 1.01
    return max(float(least), SMALLEST * ceiling), ceiling


def _level(plant: StandardPlant, gamma: float) -> Level | None:
    """None where a Riccati equation has no positive semidefinite stabilising solution."""
    state = _state_feedback(plant, gamma)
    if state is None:
        return None
    estimate = _state_feedback(plant.dual, gamma)
    if estimate is None:
        return None
    return Level(gamma, state[0], estimate[0], state[1], estimate[1].T)


def _state_feedback(plant: StandardPlant, gamma: float) -> tuple[Real, Real] | None:
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


def hamiltonian_solution(H: Real) -> Real | None:
    """Ric(H): X = X2 X1^-1 of the stable subspace of a Hamiltonian; None unless X >= 0."""
    n = len(H) // 2
    if n == 0:
        return np.zeros((0, 0))
    if not np.isfinite(H).all():
        return None
    # A balance that keeps the structure, as of SciPy's own equations.
    factor = matrix_balance(H - np.diag(np.diag(H)), permute=False, separate=True)[1][0]
    half = np.exp2(np.round(np.log2(factor[:n] / factor[n:]) / 2))
    scale = np.concatenate([half, 1.0 / half])
    H = H / scale[:, None] * scale
    try:
        T, U, stable = schur(H, sort="lhp", check_finite=False)
    except LinAlgError:  # eigenvalues so near the axis that sorting moves them across
        return None
    if stable != n:
        return None
    # Of the real Schur form the diagonal has the real parts.
    rounding, nearest = EPS * float(np.linalg.norm(H)), float(np.abs(np.diag(T)).min())
    if nearest <= NEAR_AXIS * rounding:
        return None
    X1, X2 = U[:n, :n], U[n:, :n]
    product = X1.T @ X2
    largest = max(float(np.abs(product).max()), rounding / nearest)
    if np.abs(product - product.T).max() > ASYMMETRY * largest:
        return None
    try:
        X = np.linalg.solve(X1.T, X2.T)
    except LinAlgError:
        return None
    X = (X + X.T) / 2
    values = np.linalg.eigvalsh(X)
    if values[0] < -INDEFINITE * max(values[-1], 0.0) - NEAR_AXIS * rounding / nearest:
        return None
    return X / half[:, None] / half


def _radius(X: Real, Y: Real) -> float:
    return float(np.abs(np.linalg.eigvals(X @ Y)).max()) if len(X) else 0.0


# --- the controller ---------------------------------------------------------------------------


def _made(normal: Scaled, gammas: Iterable[float], low: float) -> Central:
    """The controller of the first level at which it is proven numerically."""
    reached = "no controller could be made"
    for gamma in gammas:
        level = _level(normal.plant, gamma)
        if level is None or not level.feasible:
            continue
        try:
            K = normal.controller(_central(normal.plant, level))
            size = norm(normal.given.close(K), EXCESS)
        except (LinAlgError, ArithmeticError) as error:
            reached = str(error)
            continue
        if size <= gamma * (1.0 + EXCESS):
            return Central(K, gamma, low, size)
        reached = f"the loop of level {gamma:.6g} has norm {size:.6g}"
    raise SolverError(f"the Riccati equations are too ill-conditioned: {reached}")


def _central(plant: StandardPlant, level: Level) -> Matrices:
    """ZDG theorem 17.1 with Q = 0, for D12 = [0; I], D21 = [0 I] and D22 = 0."""
    square = level.gamma**2
    m, p = plant.controls, plant.measurements
    D11 = plant.D11
    rows, columns = len(D11) - m, D11.shape[1] - p
    D1111, D1112 = D11[:rows, :columns], D11[:rows, columns:]
    D1121, D1122 = D11[rows:, :columns], D11[rows:, columns:]
    inner = square * np.eye(rows) - D1111 @ D1111.T
    D = -D1121 @ D1111.T @ np.linalg.solve(inner, D1112) - D1122
    F12, F2 = level.F[columns : columns + p], level.F[columns + p :]
    L12, L2 = level.L[:, rows : rows + m], level.L[:, rows + m :]
    # Z = (I - Y X / gamma^2)^-1
    coupling = np.eye(plant.states) - level.Y @ level.X / square
    B = np.asarray(np.linalg.solve(coupling, (plant.B2 + L12) @ D - L2), dtype=float)
    seen = plant.C2 + F12
    return plant.A + plant.B @ level.F - B @ seen, B, F2 - D @ seen, D
