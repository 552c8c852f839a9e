"""The least norm that any controller leaves at a single frequency.

Whatever K is, the loop at a frequency is P11 + P12 Q P21 for some matrix Q. The gain to directions
of z that the controls do not reach stays, and so does the gain from directions of w that the
measurements do not show. Some Q attains the larger of the two (S. Parrott, On a quotient norm and
the Sz.-Nagy-Foias lifting theorem, J. Functional Analysis 30 (1978) 311-328). No assumption on the
plant is needed.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from workbench._core.arrays import ComplexArray, RealArray
from workbench.systems.balancing import state_units
from workbench.systems.frequency_grid import starting_grid
from workbench.systems.standard_plant import StandardPlant

LEAST_DISTANCE = 1e-8
"""Least distance of j omega - A from a singular matrix, relative to its norm, at frequencies that
are used.
"""
ROUNDING = 1e-6
"""Largest rounding error of a level at such frequencies, relative to the norm of P11. Levels are
lowered by it.
"""
STEPS = 40
"""Most steps of the search around the best frequency of the grid."""


def single_frequency_level(plant: StandardPlant) -> float:
    """The largest level of a continuous plant at single frequencies, which no controller reaches.

    It is 0 if all directions can be controlled or measured at every frequency.
    """
    z, w = plant.D11.shape
    if z <= plant.controls and w <= plant.measurements:
        return 0.0
    units = state_units(plant.A, plant.B, plant.C) if plant.states else np.ones(0)
    A, B, C = plant.A * units[:, None] / units, plant.B * units[:, None], plant.C / units
    omega = starting_grid(np.linalg.eigvals(A))

    def level(omega: float) -> float:
        response = _response((A, B, C, plant.D), omega)
        return 0.0 if response is None else _level(response, plant)

    levels = [level(each) for each in omega]
    best = int(np.argmax(levels))
    below, above = omega[max(best - 1, 0)], omega[min(best + 1, len(omega) - 1)]
    if below > 0.0 and np.isfinite(above):
        ends = float(np.log(below)), float(np.log(above))
        options = {"maxiter": STEPS}
        found = minimize_scalar(
            lambda x: -level(float(np.exp(x))), bounds=ends, method="bounded", options=options
        )
        levels.append(-float(found.fun))
    return max(levels)


def _response(
    matrices: tuple[RealArray, RealArray, RealArray, RealArray], omega: float
) -> ComplexArray | None:
    """The plant at a frequency [rad/s], which may be infinite; None at a pole, up to rounding."""
    A, B, C, D = matrices
    if np.isinf(omega) or not len(A):
        return D.astype(complex)
    inside = 1j * omega * np.eye(len(A)) - A
    sizes = np.linalg.svd(inside, compute_uv=False)
    if not sizes[-1] > LEAST_DISTANCE * sizes[0]:
        return None
    found: ComplexArray = np.asarray(D + C @ np.linalg.solve(inside, B), dtype=complex)
    return found


def _level(response: ComplexArray, plant: StandardPlant) -> float:
    """The least norm of P11 + P12 Q P21 over Q.

    All directions of the controls and of the measurements count, however small they are.
    """
    z, w = plant.D11.shape
    P11, P12, P21 = response[:z, :w], response[:z, w:], response[z:, :w]
    levels = [0.0]
    if z > plant.controls:
        left = np.linalg.svd(P12)[0][:, plant.controls :]
        levels.append(float(np.linalg.norm(left.conj().T @ P11, 2)))
    if w > plant.measurements:
        right = np.linalg.svd(P21)[2][plant.measurements :]
        levels.append(float(np.linalg.norm(P11 @ right.conj().T, 2)))
    return max(0.0, max(levels) - ROUNDING * float(np.linalg.norm(P11, 2)))
