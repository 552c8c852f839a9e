"""The matrix inequalities of mixed H2/H-infinity synthesis with one Lyapunov matrix.

C. Scherer, P. Gahinet, M. Chilali, Multiobjective output-feedback control via LMI optimization,
IEEE Trans. Automatic Control 42 (1997) 896-911; I. Masubuchi, A. Ohara, N. Suda, LMI-based
controller synthesis, Int. J. Robust and Nonlinear Control 8 (1998) 669-686, for sampled time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import null_space

from workbench._core.arrays import RealArray
from workbench.synthesis.h2.direct import cancelling_gain
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

LEAST_MOVE = 1e-6
"""Smallest change of the state in a sample that is distinguished from zero."""


class MixedInequalities:
    """Variables of the controller and of the Lyapunov matrix, and their inequalities.

    ``energy`` bounds the square of the H2 norm of one plant, and gamma the H-infinity norm of
    another. The two plants differ only in their exogenous inputs and performance outputs. The
    second inequality has the factor ``share`` on gamma on the side of the inputs, and its inverse
    on the side of the outputs. A good share lets one Lyapunov matrix suit both inequalities better.
    """

    def __init__(self, performance: StandardPlant, limited: StandardPlant, gamma: float) -> None:
        import cvxpy as cp

        plant = performance
        n, m, p = plant.states, plant.controls, plant.measurements
        self.plant = plant
        self.X, self.Y = (cp.Variable((n, n), symmetric=True) for _ in range(2))
        self.A, self.B, self.C = cp.Variable((n, n)), cp.Variable((n, p)), cp.Variable((m, n))
        self.D = _direct_term(performance)
        self.share, self.inverse = cp.Parameter(pos=True), cp.Parameter(pos=True)
        z = len(performance.C1)
        W = cp.Variable((z, z), symmetric=True)
        self.energy = cp.trace(W)
        self.P = cp.bmat([[self.X, np.eye(n)], [np.eye(n), self.Y]])
        held = (
            (*self._sampled_h2(performance, W), self._sampled_hinf(limited, gamma))
            if plant.dt
            else (*self._h2(performance, W), self._hinf(limited, gamma))
        )
        self.constraints = [(one + one.T) / 2 >> 0 for one in held]

    def set_share(self, share: float) -> None:
        """Set the factor of gamma on the side of the inputs."""
        self.share.value, self.inverse.value = share, 1.0 / share

    def controller(self) -> Matrices:
        """The controller K from the values found; I - X Y must not be singular."""
        A, B2, C2 = self.plant.A, self.plant.B2, self.plant.C2
        X, Y = self.X.value, self.Y.value
        Dk = np.asarray(getattr(self.D, "value", self.D), dtype=float)
        U, sizes, Vh = np.linalg.svd(np.eye(len(A)) - X @ Y)
        M, N = U * np.sqrt(sizes), Vh.T * np.sqrt(sizes)
        Ck = np.linalg.solve(M, (self.C.value - Dk @ C2 @ X).T).T
        Bk = np.linalg.solve(N, self.B.value - Y @ B2 @ Dk)
        inner = self.A.value - N @ Bk @ C2 @ X - Y @ B2 @ Ck @ M.T - Y @ (A + B2 @ Dk @ C2) @ X
        return np.linalg.solve(N, np.linalg.solve(M, inner.T).T), Bk, Ck, Dk

    def _loop(self, plant: StandardPlant) -> tuple[Any, Any, Any, Any]:
        """P A, P B, C and D of the closed loop; all are linear in the variables."""
        import cvxpy as cp

        A, B1, B2, C1, C2 = plant.A, plant.B1, plant.B2, plant.C1, plant.C2
        X, Y, D = self.X, self.Y, self.D
        state = cp.bmat(
            [
                [A @ X + B2 @ self.C, A + B2 @ D @ C2],
                [self.A, Y @ A + self.B @ C2],
            ]
        )
        enters = cp.vstack([B1 + B2 @ D @ plant.D21, Y @ B1 + self.B @ plant.D21])
        leaves = cp.hstack([C1 @ X + plant.D12 @ self.C, C1 + plant.D12 @ D @ C2])
        return state, enters, leaves, plant.D11 + plant.D12 @ D @ plant.D21

    def _h2(self, plant: StandardPlant, W: Any) -> tuple[Any, Any]:
        import cvxpy as cp

        A, B, C, _ = self._loop(plant)
        return (
            -cp.bmat([[A + A.T, B], [B.T, -np.eye(B.shape[1])]]),
            cp.bmat([[self.P, C.T], [C, W]]),
        )

    def _hinf(self, plant: StandardPlant, gamma: float) -> Any:
        import cvxpy as cp

        A, B, C, D = self._loop(plant)
        z, w = D.shape
        return -cp.bmat(
            [
                [A + A.T, B, C.T],
                [B.T, -gamma * self.share * np.eye(w), D.T],
                [C, D, -gamma * self.inverse * np.eye(z)],
            ]
        )

    def _sampled_h2(self, plant: StandardPlant, W: Any) -> tuple[Any, Any]:
        import cvxpy as cp

        A, B, C, D = self._loop(plant)
        n, w = A.shape[0], D.shape[1]
        none, one = np.zeros((n, w)), np.eye(w)
        return (
            self._rows_by_difference(
                cp.bmat([[self.P, A, B], [A.T, self.P, none], [B.T, none.T, one]])
            ),
            cp.bmat([[W, C, D], [C.T, self.P, none], [D.T, none.T, one]]),
        )

    def _sampled_hinf(self, plant: StandardPlant, gamma: float) -> Any:
        import cvxpy as cp

        A, B, C, D = self._loop(plant)
        n, (z, w) = A.shape[0], D.shape
        stated = cp.bmat(
            [
                [self.P, A, B, np.zeros((n, z))],
                [A.T, self.P, np.zeros((n, w)), C.T],
                [B.T, np.zeros((w, n)), gamma * self.share * np.eye(w), D.T],
                [np.zeros((z, n)), C, D, gamma * self.inverse * np.eye(z)],
            ]
        )
        return self._rows_by_difference(stated)

    def _rows_by_difference(self, stated: Any) -> Any:
        """A sampled inequality whose first two block rows are replaced by one and by their scaled
        difference.

        If the state changes little in a sample, both rows are nearly the same.
        """
        n = 2 * self.plant.states
        moved = float(np.linalg.norm(self.plant.A - np.eye(len(self.plant.A)), 2))
        T = np.eye(stated.shape[0])
        T[:n, n : 2 * n] = -np.eye(n)
        T[:n] /= np.sqrt(np.clip(moved, LEAST_MOVE, 1.0))
        return T @ stated @ T.T


def _direct_term(plant: StandardPlant) -> Any:
    """The controller's direct term: free, but in continuous time it must cancel that of the
    loop.
    """
    import cvxpy as cp

    m, p = plant.controls, plant.measurements
    if plant.dt:
        return cp.Variable((m, p))
    least: RealArray = cancelling_gain(plant)
    # vec(D12 D D21) = (D21' x D12) vec(D), by columns
    free = null_space(np.kron(plant.D21.T, plant.D12))
    if not free.shape[1]:
        return least
    return least + cp.reshape(free @ cp.Variable(free.shape[1]), (m, p), order="F")
