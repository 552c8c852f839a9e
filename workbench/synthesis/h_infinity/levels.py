"""Levels of H-infinity synthesis: feasibility of a norm gamma, and the least feasible gamma.

K. Zhou, J. Doyle, K. Glover, Robust and Optimal Control (1996), theorem 17.1, called ZDG here, for
plants with D12 = [0; I], D21 = [0 I] and D22 = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import RealArray
from workbench.errors import SolverError
from workbench.executor.clock import tick, time_is_up
from workbench.systems.equations.riccati import hamiltonian_solution
from workbench.systems.frequency_response import frequency_response
from workbench.systems.norms import hinf_norm
from workbench.systems.standard_plant import StandardPlant

NEGLIGIBLE_LEVEL = 1e-6
"""Levels below this share of the norm of the H2-optimal controller's loop count as zero."""
CANCELLED_SHARE, ZERO_LEVEL_SHARE = 1e-13, 1e-7
"""A norm of the loop below the first share of w -> z without K is a rounding error. The level is
then the second share.
"""
MIDDLE_POINT = np.exp(0.5j)
"""A point of middle frequency in the scaled s plane, away from the axis, since poles may lie
there.
"""
LARGEST_LEVEL = 1e100
"""Largest level that numerically differs from infinity."""
MOST_LEVELS, INTERPOLATED_LEVELS = 80, 8
"""Largest number of levels tried, and the number of levels after which every second one halves the
interval.
"""
PROBED_SHARES = (0.65, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995, 0.998)
"""Shares of the least level found, tried in addition, since rounding may hide feasible levels."""
MOST_SECANT_STEPS, SECANT_REACH = 25, 1.1
"""Largest number of steps of the secant method, and the largest factor on the level in one step."""
EVEN_STEEPNESS = 2.0
"""Derivative of the inverse coupling by log gamma if X and Y do not depend on gamma."""
NEAR_SHARES = (0.04, 0.08, 0.12)
"""Shares of the tolerance above an infeasible level at which feasibility is tried again."""


@dataclass(frozen=True, eq=False)
class Level:
    """Positive semidefinite solutions X and Y for a level gamma, with their gains F and L."""

    gamma: float
    X: RealArray
    Y: RealArray
    F: RealArray
    L: RealArray

    @cached_property
    def coupling(self) -> float:
        """rho(X Y) / gamma^2, which is below 1 for a feasible level."""
        return _spectral_radius(self.X, self.Y) / self.gamma**2

    @property
    def feasible(self) -> bool:
        return self.coupling < 1.0


def least_level(plant: StandardPlant, tolerance: float) -> tuple[float, Level]:
    """A level that no controller reaches, and a feasible level close above it.

    `tolerance` is the relative width of the interval between both. Raises SolverError if no
    feasible level is found.
    """
    floor, ceiling = level_ends(plant)
    low, high = floor, ceiling
    best = level_at(plant, high)
    for _ in range(MOST_LEVELS):
        if best is not None and best.feasible:
            break
        low, high = high, 2.0 * high
        best = level_at(plant, high)
    else:
        raise SolverError(f"no level up to gamma = {high:.3g} is feasible, numerically")
    low, below, best = _bisect_level(plant, low, best, tolerance)
    if below is not None:  # X and Y exist, and their coupling shows that no lower level is feasible
        return low, best
    # Rounding errors may hide slow modes, and then a feasible level seems infeasible.
    for share in PROBED_SHARES:
        if time_is_up("search for hidden levels"):
            break
        level = level_at(plant, share * best.gamma) if share * best.gamma > floor else None
        if level is not None and level.feasible:
            low, _, best = _bisect_level(plant, floor, level, tolerance)
    return low, best


def level_from(
    plant: StandardPlant,
    guess: float,
    tolerance: float,
    steepness: float = EVEN_STEEPNESS,
    most: float = math.inf,
) -> tuple[Level, float] | None:
    """The level with a coupling of 1, found from a guess by the secant method.

    None if it is not found or is at least ``most``.

    Levels without X and Y, or with a coupling above 1, are lower bounds; others are upper bounds.
    The ``steepness`` is the guess for the first step of the derivative of the inverse coupling by
    log gamma. Its last estimate is returned too.
    """
    gamma, low, high = guess, 0.0, math.inf
    last: Level | None = None
    for _ in range(MOST_SECANT_STEPS):
        tick("search for the least level")
        level = level_at(plant, gamma)
        if level is None or not level.coupling > 0.0:
            low = new = gamma
        else:
            if level.feasible:
                high = gamma
            else:
                low = gamma
            if last is not None and last.coupling != level.coupling:
                rise = 1.0 / level.coupling - 1.0 / last.coupling
                seen = rise / math.log(level.gamma / last.gamma)
                steepness = seen if seen > 0.0 else EVEN_STEEPNESS
            new = gamma * math.exp((1.0 - 1.0 / level.coupling) / steepness)
            if abs(new - gamma) <= tolerance * gamma:
                return level, steepness
            last = level
        if low >= most:
            return None
        if not low < new < high:
            new = math.sqrt(low * high) if high < math.inf else SECANT_REACH * low
        gamma = min(max(new, gamma / SECANT_REACH), gamma * SECANT_REACH)
    return None


def _interpolated_level(one: Level, other: Level) -> float:
    """The level at which the inverse coupling is 1, by linear interpolation in gamma."""
    a, b = 1.0 / one.coupling - 1.0, 1.0 / other.coupling - 1.0
    return one.gamma - (other.gamma - one.gamma) * a / (b - a)


def _bisect_level(
    plant: StandardPlant, low: float, best: Level, tolerance: float
) -> tuple[float, Level | None, Level]:
    """A level at which no controller was found, and a feasible level close above it.

    The second result is the lower level with its X and Y; None if it has none.
    """
    below: Level | None = None
    step = 0
    while best.gamma > (1.0 + tolerance) * low and step < MOST_LEVELS:
        if time_is_up("bisection of the level"):
            break
        trial = _next_level(low, below, best, tolerance, step)
        level = _level_near(plant, trial, tolerance)
        if level is not None and level.feasible:
            best = level
        else:
            low, below = trial, level
        step += 1
    return low, below, best


def _level_near(plant: StandardPlant, gamma: float, tolerance: float) -> Level | None:
    """A feasible level just above `gamma`, or else the result for `gamma` itself.

    Near the least level, rounding makes single levels between feasible ones seem infeasible.
    """
    first = level_at(plant, gamma)
    if first is not None and first.feasible:
        return first
    for share in NEAR_SHARES:
        level = level_at(plant, (1.0 + share * tolerance) * gamma)
        if level is not None and level.feasible:
            return level
    return first


def _next_level(low: float, below: Level | None, best: Level, tolerance: float, step: int) -> float:
    """The next level to try: the one with a coupling of 1 by interpolation, or the middle."""
    high = best.gamma
    middle = math.sqrt(low * high)
    if below is None or best.coupling <= 0.0 or (step > INTERPOLATED_LEVELS and step % 2):
        return middle
    inside = 1.0 + tolerance / 4
    return min(max(_interpolated_level(below, best), low * inside), high / inside)


def level_ends(plant: StandardPlant) -> tuple[float, float]:
    """A lower bound on the least level, and a level to start from: the loop's norm for gamma =
    infinity.

    The least level is at least the norm of the parts of D11 that K cannot change (Parrott). It is
    also at least the square root of rho(X Y) at gamma = infinity, because X and Y grow as gamma
    decreases.
    """
    m, p = plant.controls, plant.measurements
    state, estimate = state_feedback(plant, math.inf), state_feedback(plant.dual, math.inf)
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
    # The H2-optimal controller, with a direct term that cancels that of w -> z.
    F2, L2 = F[D11.shape[1] :], L[len(D11) :].T
    Bk = plant.B2 @ direct - L2
    K = (plant.A + plant.B2 @ F2 - Bk @ plant.C2, Bk, F2 - direct @ plant.C2, direct)
    least = max(
        np.linalg.norm(D11[: len(D11) - m], 2) if len(D11) > m else 0.0,
        np.linalg.norm(D11[:, : D11.shape[1] - p], 2) if D11.shape[1] > p else 0.0,
        math.sqrt(_spectral_radius(X, Y)),
    )
    try:
        ceiling = 1.01 * hinf_norm(plant.close(K), 1e-3)
    except ArithmeticError:  # SLICOT did not converge
        ceiling = math.inf
    if not 0.0 < ceiling < math.inf:  # any level can be the first one to try
        ceiling = 2.0 * float(least) or 1.0
    size = without_control(plant)
    if ceiling < CANCELLED_SHARE * size:  # K cancels w -> z: use a level that counts as zero
        return ZERO_LEVEL_SHARE * size, ZERO_LEVEL_SHARE * size
    return max(float(least), NEGLIGIBLE_LEVEL * ceiling), ceiling


def without_control(plant: StandardPlant) -> float:
    """The size of w -> z without K at high and at middle frequencies."""
    M = np.block([[plant.A, plant.B1], [plant.C1, plant.D11]])
    middle = frequency_response(M, plant.states, MIDDLE_POINT)
    return float(max(np.linalg.norm(plant.D11), np.linalg.norm(middle)))


def level_at(plant: StandardPlant, gamma: float) -> Level | None:
    """X, Y and gains of a level; None if a Riccati equation has no stabilising X or Y >= 0."""
    state = state_feedback(plant, gamma)
    if state is None:
        return None
    estimate = state_feedback(plant.dual, gamma)
    if estimate is None:
        return None
    return Level(gamma, state[0], estimate[0], state[1], estimate[1].T)


def state_feedback(plant: StandardPlant, gamma: float) -> tuple[RealArray, RealArray] | None:
    """X and F = -R^-1 (D1^T C1 + B^T X), R = D1^T D1 - diag(gamma^2 I, 0) (ZDG eq. 17.1 to 17.4).

    The control u is chosen to cancel the last performance outputs and to add v, so that these
    outputs equal v; the equations for v then have no cancellation. None if there is no X >= 0, or
    if gamma is at most the norm of D11 without its last rows.
    """
    split = len(plant.D11) - plant.controls
    C, D = plant.C1[:split], plant.D11[:split]
    C_u, D_u = plant.C1[split:], plant.D11[split:]
    A, B = plant.A - plant.B2 @ C_u, plant.B1 - plant.B2 @ D_u
    shrink = 1.0 / gamma / gamma  # 0 at infinity
    left = np.eye(D.shape[1]) - shrink * D.T @ D
    if not np.linalg.eigvalsh(left)[0] > 0.0:
        return None
    # The worst w is (across + back X) x, and the best v is -B2^T X x.
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


def _spectral_radius(X: RealArray, Y: RealArray) -> float:
    """Spectral radius of X Y."""
    return float(np.abs(np.linalg.eigvals(X @ Y)).max()) if len(X) else 0.0
