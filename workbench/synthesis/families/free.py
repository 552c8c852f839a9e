"""All controllers of an order, with all entries of their matrices free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.synthesis.families.family import Family
from workbench.systems.balancing import balanced
from workbench.systems.realisation import Matrices


@dataclass(frozen=True)
class FreeMatrices(Family):
    """Controllers with n states, m inputs and p outputs; the parameters are A, B, C and D, row by
    row.

    There are more parameters than a controller has degrees of freedom, since coordinates of the
    state are free. But unlike in `Modal` the parameters are not singular where two poles become
    equal, so a descent can go on there.
    """

    order: int
    inputs: int
    outputs: int

    @property
    def count(self) -> int:
        return (self.order + self.outputs) * (self.order + self.inputs)

    def matrices(self, x: RealArray) -> Matrices:
        """A, B, C and D of the controller with parameters x."""
        n = self.order
        whole = x.reshape(n + self.outputs, n + self.inputs)
        return whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]

    def system(self, x: RealArray) -> StateSpace:
        import control

        return control.StateSpace(*self.matrices(x), 0, remove_useless_states=False)

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        A, B, C, D = self.matrices(x)
        n, m, p, count = self.order, self.inputs, self.outputs, len(omega)
        resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(n) - A)
        # K = D + C R B changes by [C R, I] dX [R B; I] when X = [A B; C D] changes by dX.
        ones = np.ones((count, 1, 1))
        left = np.concatenate([C @ resolvent, ones * np.eye(p)], axis=2)
        right = np.concatenate([resolvent @ B, ones * np.eye(m)], axis=1)
        K: ComplexArray = np.asarray(C @ resolvent @ B + D, dtype=complex)
        outer = left.swapaxes(1, 2)[:, :, None, :, None] * right[:, None, :, None, :]
        slopes = outer.reshape(count, len(x), p, m)
        return K, slopes

    def parameters(self, controller: StateSpace) -> RealArray:
        if controller.nstates != self.order:
            raise InputError(
                f"the controller has {controller.nstates} states, a member of {self} {self.order}"
            )
        A, B, C = balanced(*map(np.asarray, (controller.A, controller.B, controller.C)))
        return np.block([[A, B], [C, np.asarray(controller.D)]]).ravel()
