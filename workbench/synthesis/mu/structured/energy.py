"""The energy, which is the squared H2 norm of a loop, as a function of the parameters of a family.

With the Gramians P and Q of the loop A_c, B_c, C_c, the derivative of tr(B_c' Q B_c) by the
controller's matrices is twice a sum of products with P and Q (T. Rautert, E. W. Sachs,
Computational design of optimal output feedback controllers, SIAM J. Optimization 7 (1997) 837-852).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError, null_space, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import Family
from workbench.synthesis.h2.direct import DIRECT_TERM_ROUNDING, direct_term
from workbench.systems.balancing import balanced, state_units
from workbench.systems.bilinear import from_continuous_plane
from workbench.systems.equations.gramians import gramian_factors
from workbench.systems.realisation import Matrices, matrices_of, realisation
from workbench.systems.standard_plant import StandardPlant

DIFFERENCE = 1e-6
"""Step of the differences of the loop's matrices, in units of the parameters."""


@dataclass(frozen=True, eq=False)
class EnergyProblem:
    """The square of the H2 norm of the loop as a function of the parameters of a family."""

    plant: StandardPlant
    family: Family
    demands: Shippable

    def controller(self, x: RealArray) -> StateSpace:
        """The controller with parameters x, in the plant's time."""
        return from_continuous_plane(self.family.system(x), self.plant.dt)

    def closed(self, x: RealArray) -> Matrices:
        """The closed loop with parameters x; raises LinAlgError if direct terms leave it
        undetermined.
        """
        return self.plant.close(matrices_of(self.controller(x)))

    def value(self, x: RealArray) -> float:
        """The energy; infinite if the loop is not stable or K does not meet the demands."""
        return self._gramians(x)[0]

    def slopes(self, x: RealArray) -> RealArray:
        """Derivatives (k,) of the energy by the parameters x of a stable loop."""
        value, P, Q, (A, B, C, D) = self._gramians(x)
        assert math.isfinite(value)
        by_A = Q @ A @ P if self.plant.dt else Q @ P
        parts = zip(self._derivatives(x), (by_A, Q @ B, C @ P, D), strict=True)
        return np.asarray(sum(2.0 * np.einsum("kij,ij->k", each, by) for each, by in parts))

    def direct(self, x: RealArray) -> tuple[RealArray, RealArray]:
        """Direct terms (r,) of a continuous loop, which must be zero, and their derivatives
        (r, k).
        """
        if self.plant.dt:
            return np.zeros(0), np.zeros((0, len(x)))
        slopes = self._derivatives(x)[3].reshape(len(x), -1).T
        return self.closed(x)[3].ravel(), slopes

    def free_directions(self, x: RealArray) -> RealArray:
        """Directions (k, f) of the parameters that change no direct term of a continuous loop."""
        moved = self.direct(x)[1]
        return np.asarray(null_space(moved) if moved.any() else np.eye(len(x)), dtype=float)

    def without_direct(self, x: RealArray) -> RealArray:
        """Parameters near x whose continuous loop has no direct term, if there are any."""
        value, moved = self.direct(x)
        if not len(value):
            return x
        return x - np.asarray(np.linalg.lstsq(moved, value, rcond=None)[0], dtype=float)

    def _gramians(self, x: RealArray) -> tuple[float, RealArray, RealArray, Matrices]:
        """The energy, both Gramians, and the loop."""
        none = np.zeros((0, 0))
        dt = self.plant.dt
        unstable = math.inf, none, none, (none,) * 4
        member = self.family.system(x)
        if self.demands.asked and not self.demands.admits(member):
            return unstable
        try:
            K = from_continuous_plane(member, dt)
            A, B, C, D = loop = self.plant.close(matrices_of(K))
        except LinAlgError:
            return unstable
        if not stability_check(realisation(loop, dt)).holds:
            return unstable
        if not dt and not direct_term(self.plant, K.D) <= DIRECT_TERM_ROUNDING:
            return unstable
        try:
            P, Q = _gramians(A, B, C, dt)
        except (LinAlgError, InputError, RuntimeWarning):  # singular up to rounding
            return unstable
        energy = float(np.trace(B.T @ Q @ B) + np.sum(D**2))
        return (energy, P, Q, loop) if energy >= 0.0 else unstable

    def _derivatives(self, x: RealArray) -> list[RealArray]:
        """Derivatives (k, ...) of the matrices of the loop by the parameters."""
        steps = DIFFERENCE * np.maximum(self.family.units(x), DIFFERENCE)
        found = []
        for place, step in enumerate(steps):
            change = np.zeros(len(x))
            change[place] = step
            above, below = self.closed(x + change), self.closed(x - change)
            found.append([(a - b) / (2 * step) for a, b in zip(above, below, strict=True)])
        return [np.array(each) for each in zip(*found, strict=True)]


def _gramians(A: RealArray, B: RealArray, C: RealArray, dt: float) -> tuple[RealArray, RealArray]:
    """The Gramians of a stable system; warnings of SciPy become errors.

    In continuous time they are products of factors: beside a pole as fast as that of a derivative's
    filter, the equations themselves lose digits, up to the sign of the energy.
    """
    if not dt:
        units = state_units(A, B, C)
        S, R = gramian_factors(*balanced(A, B, C))
        S, R = S / units[:, None], R * units
        return S @ S.T, R.T @ R
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        P, Q = (solve_discrete_lyapunov(*pair) for pair in ((A, B @ B.T), (A.T, C.T @ C)))
    return np.asarray(P, dtype=float), np.asarray(Q, dtype=float)
