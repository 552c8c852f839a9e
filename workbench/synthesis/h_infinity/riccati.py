"""H-infinity synthesis by two Riccati equations, fast enough for use inside an iteration.

K. Glover, J. Doyle, State-space formulae for all stabilizing controllers that satisfy an
H-infinity norm bound, Systems and Control Letters 11 (1988) 167-172; K. Zhou, J. Doyle, K. Glover,
Robust and Optimal Control (1996), theorem 17.1, called ZDG here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError

from workbench._core.arrays import RealArray
from workbench.errors import SolverError
from workbench.synthesis.h_infinity.levels import LARGEST_LEVEL, Level, least_level, level_at
from workbench.synthesis.h_infinity.normalised import Scaled, normalised_plant
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

LEVEL_RISE_MULTIPLES = (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)
"""Multiples of the tolerance by which the level is raised until the loop's norm is below it."""
MANY_RISES = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 30.0, 100.0, 1000.0)
"""The same for cases in which a low level matters more than time. Rounding decides which of several
close levels the loop holds.
"""
LEVEL_ROUNDING = 1e-6
"""Share by which rounding errors may lift the norm of a loop above its level."""


class Central(NamedTuple):
    """A controller K = (A, B, C, D) whose loop has ``norm``, at most its level ``gamma``.

    Unlike an `HinfController`, it has arrays, for a scaled plant, and is not certified yet.

    By the Riccati equations no level below ``lower`` has a controller. If rounding lets the norm be
    below this value, ``lower`` is the norm.
    """

    K: Matrices
    gamma: float
    lower: float
    norm: float


class InfeasibleError(SolverError):
    """No controller reaches the given level; the least level lies above ``lower``."""

    def __init__(self, gamma: float, lower: float) -> None:
        super().__init__(
            f"no stabilising controller has a norm below gamma = {gamma:.6g}; the least level lies "
            f"above {lower:.6g}"
        )
        self.lower = lower


def central_controller(
    A: RealArray,
    B: RealArray,
    C: RealArray,
    D: RealArray,
    controls: int,
    measurements: int,
    tolerance: float = 1e-3,
    gamma: float | None = None,
) -> Central:
    """The central controller of a continuous-time plant, u = K y with positive feedback.

    Parameters
    ----------
    A, B, C, D
        Matrices of the plant; its last inputs are the controls, its last outputs the measurements.
    tolerance
        Relative width of the interval that contains the least level. The controller is designed for
        a level higher by the same share, since a controller at the least level has poles at
        infinity.
    gamma
        The level; None for the least level.

    Raises
    ------
    InputError
        D12 or D21 does not have full rank; an unstable mode is hidden.
    InfeasibleError
        No controller reaches the given level.
    SolverError
        No level is feasible, or no controller found keeps its loop below its level.
    """
    plant = StandardPlant(A, B, C, D, controls, measurements)
    return central_of(normalised_plant(plant), tolerance, gamma)


def central_of(
    normal: Scaled,
    tolerance: float,
    gamma: float | None = None,
    rises: tuple[float, ...] = LEVEL_RISE_MULTIPLES,
) -> Central:
    """The central controller, as from `central`, for a plant that is already scaled.

    ``rises`` are the multiples of the tolerance by which the least level is raised.
    """
    plant = normal.plant
    if gamma is None:
        low, best = least_level(plant, tolerance)
        return _first_that_holds(normal, [best.gamma * (1.0 + tolerance * k) for k in rises], low)
    gamma = min(gamma, LARGEST_LEVEL)
    level = level_at(plant, gamma)
    if level is None or not level.feasible:
        raise InfeasibleError(gamma, least_level(plant, tolerance)[0])
    return _first_that_holds(normal, [gamma], 0.0)


def central_above(normal: Scaled, least: float, tolerance: float) -> Central:
    """As `central_of`, if the least level is already known."""
    return _first_that_holds(
        normal, [least * (1.0 + tolerance * k) for k in LEVEL_RISE_MULTIPLES], 0.0
    )


def _first_that_holds(normal: Scaled, gammas: list[float], low: float) -> Central:
    """The controller of the first level whose loop has a norm below the level.

    If rounding keeps the norms of all loops above their levels, the controller with the least norm
    is returned, provided that this norm is at most one of the levels. The norm is then its level.
    """
    best, reached = None, "no controller could be made"
    for gamma in gammas:
        if best is not None and best.norm <= gamma:
            return best
        level = level_at(normal.plant, gamma)
        if level is None or not level.feasible:
            continue
        try:
            K = normal.controller(_central(normal.plant, level))
            loop = normal.given.close(K)
            size = hinf_norm(loop, LEVEL_ROUNDING)
        except (LinAlgError, ArithmeticError) as error:
            reached = " ".join(str(error).split())
            continue
        if size <= gamma * (1.0 + LEVEL_ROUNDING):
            return Central(K, gamma, min(low, size), size)
        reached = f"the loop of level {gamma:.6g} has norm {size:.6g}"
        if not math.isfinite(size):
            poles = np.abs(np.linalg.eigvals(loop[0]))
            reached = (
                f"the loop of level {gamma:.6g} is not stable, numerically: its poles lie between "
                f"{poles.min():.3g} and {poles.max():.3g} rad/s"
            )
        elif best is None or size < best.norm:
            best = Central(K, size, min(low, size), size)
    raise SolverError(
        f"the Riccati equations are too ill-conditioned: {reached}; slow weights, cheap control "
        "and little noise part poles: add to the weight on u and to the noise on y, as "
        "regularised() of a larger size does"
    )


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
