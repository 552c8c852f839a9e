"""The H-infinity norm of a loop as a function of the parameters of a controller, with its gradient.

At the frequency of the peak the largest singular value changes by Re(u* dN v), where u and v are
its singular vectors and dN = back dK out. SLICOT finds peak and frequency (N. A. Bruinsma, M.
Steinbuch, A fast algorithm to compute the H-infinity norm of a transfer function matrix, Systems &
Control Letters 14 (1990) 287-293).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError

from workbench._core.arrays import RealArray
from workbench.solvers import slicot_routine
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.family import Family
from workbench.systems.norms import stable
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

NORM_ACCURACY = 1e-8
"""Relative accuracy of norms that a descent compares."""
FAR = 1e30
"""Loops with a larger entry are not evaluated."""


@dataclass(frozen=True, eq=False)
class LoopNorm:
    """The norm of a continuous plant's loop as a function of the parameters of a family."""

    plant: StandardPlant
    family: Family
    demands: Shippable

    @cached_property
    def _opened(self) -> StandardPlant:
        """The plant whose controls are also exogenous inputs, and whose measurements are also
        outputs.
        """
        P = self.plant
        B, C = np.hstack([P.B1, P.B2, P.B2]), np.vstack([P.C1, P.C2, P.C2])
        D = np.block([[P.D11, P.D12, P.D12], *2 * [[P.D21, P.D22, P.D22]]])
        return StandardPlant(P.A, B, C, D, P.controls, P.measurements)

    def closed(self, x: RealArray) -> Matrices | None:
        """The stable loop with parameters x of the opened plant; None if it is unstable or K does
        not meet the demands.
        """
        try:
            loop = self._opened.close(self.family.matrices(x))
        except LinAlgError:
            return None
        if not all(np.abs(part).max(initial=0.0) < FAR for part in loop) or not stable(loop[0]):
            return None
        if self.demands.asked_of_poles and not self.demands.admits(self.family.system(x)):
            return None
        return loop

    def value(self, x: RealArray) -> float:
        """The norm; infinite if the loop is unstable or K does not meet the demands."""
        loop = self.closed(x)
        return math.inf if loop is None else self._peak(loop)[0]

    def valued(self, x: RealArray) -> tuple[float, RealArray]:
        """The norm, and its gradient (k,) by the parameters at the peak."""
        loop = self.closed(x)
        peak, omega = (math.inf, 0.0) if loop is None else self._peak(loop)
        if loop is None or not math.isfinite(peak):
            return math.inf, np.zeros(len(x))
        return peak, self._slopes(loop, x, np.array([min(omega, FAR)]), 1)[1][0, 0]

    def singular_values(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray] | None:
        """Singular values (F, s) at omega (F,) [rad/s], and their derivatives (F, s, k) by x.

        None if the loop is unstable or K does not meet the demands.
        """
        loop = self.closed(x)
        return None if loop is None else self._slopes(loop, x, omega, min(self._shape))

    @property
    def _shape(self) -> tuple[int, int]:
        """Numbers of performance outputs and exogenous inputs."""
        return len(self.plant.C1), self.plant.B1.shape[1]

    def _peak(self, loop: Matrices) -> tuple[float, float]:
        """The norm of a stable opened loop, and the frequency of its peak."""
        A, B, C, D = loop
        z, w = self._shape
        return peak_of((A, B[:, :w], C[:z], D[:z, :w]))

    def _slopes(
        self, loop: Matrices, x: RealArray, omega: RealArray, most: int
    ) -> tuple[RealArray, RealArray]:
        """The largest singular values (F, most) of an opened loop, and their derivatives."""
        A, B, C, D = loop
        z, w = self._shape
        inside = 1j * omega[:, None, None] * np.eye(len(A)) - A
        whole = C @ np.linalg.solve(inside, np.broadcast_to(B, (len(omega), *B.shape))) + D
        u, size, vh = np.linalg.svd(whole[:, :z, :w], full_matrices=False)
        left = u[:, :, :most].conj().swapaxes(1, 2) @ whole[:, :z, w:]
        right = whole[:, z:, :w] @ vh[:, :most].conj().swapaxes(1, 2)
        # Re(left dK right) = Re(sum over entries of dK of left right')
        count, entries = len(omega), left.shape[2] * right.shape[1]
        by_entry = (left[:, :, :, None] * right.swapaxes(1, 2)[:, :, None, :]).reshape(
            count, -1, entries
        )
        moved = self.family.response(x, omega)[1].reshape(count, len(x), entries)
        slopes: RealArray = (by_entry @ moved.swapaxes(1, 2)).real
        return size[:, :most], slopes


def peak_of(loop: Matrices) -> tuple[float, float]:
    """The norm of a stable loop and the frequency of its peak [rad/s]; infinite if SLICOT fails.

    The states are balanced first: SLICOT overlooks peaks where their units are too different.
    """
    A, B, C, D = loop
    if not len(A):
        return float(np.linalg.norm(D, 2)), 1.0
    sizes = len(A), B.shape[1], len(C)
    unit = np.eye(len(A))
    try:
        _, A, B, C, _ = slicot_routine("tb01id")(*sizes, 0.0, A, B, C)
        peak, omega = slicot_routine("ab13dd")(
            "C", "I", "S", "D", *sizes, A, unit, B, C, D, NORM_ACCURACY
        )
    except ArithmeticError:
        return math.inf, 0.0
    return float(peak), float(omega)
