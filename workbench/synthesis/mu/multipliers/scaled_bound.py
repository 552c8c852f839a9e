"""The bound on mixed mu that given scalings prove, with its derivatives, for many frequencies.

Let Y = D M D^-1, and let F be real and diagonal on the channels of real scalars, zero elsewhere.
Mu is at most the least beta for which

    Y^H Y + j beta (F Y - Y^H F) <= beta^2.

This is the upper bound of `workbench.mu` with D^H D and G = beta D^H F D. By a Schur complement,
beta is the largest eigenvalue of [j (F Y - Y^H F), Y^H; Y, 0]; without F it is sigma_max(Y).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray


@dataclass(frozen=True, eq=False)
class ScaledBound:
    """Bounds ``beta`` (F,) and the vectors that give their derivatives.

    A change dD changes beta by beta * Re tr((p q^H - s t^H) dD D^-1), where D is that of the
    outputs for p, q and that of the inputs for s, t. A change dF changes beta by beta * by_turn dF.
    Shapes are (F, c) of p and q, (F, r) of s and t, and (F, k) of by_turn.
    """

    beta: RealArray
    p: Array
    q: Array
    s: Array
    t: Array
    by_turn: RealArray

    def change(self, row: slice, column: slice) -> Array:
        """The matrix p q^H - s t^H (F, n, n) of a square block."""
        p, q, s, t = self.p[:, row], self.q[:, row], self.s[:, column], self.t[:, column]
        out: Array = np.einsum("fi,fj->fij", p, q.conj()) - np.einsum("fi,fj->fij", s, t.conj())
        return out

    def trace(self, row: slice, column: slice) -> RealArray:
        """Trace of p q^H - s t^H (F,) for a block, square or not."""
        out = np.einsum("fi,fi->f", self.p[:, row], self.q[:, row].conj())
        into = np.einsum("fi,fi->f", self.s[:, column], self.t[:, column].conj())
        return np.asarray((out - into).real)


def scaled_bound(Y: Array, F: RealArray, into: Any, out: Any) -> ScaledBound:
    """The bound for Y (F, c, r) and F (F, k) on columns `into` and rows `out` of Y."""
    c, r = Y.shape[1:]
    adjoint = Y.conj().mT
    if not F.shape[1]:
        values, vectors = np.linalg.eigh(adjoint @ Y)
        beta, x = np.sqrt(values[:, -1]), vectors[:, :, -1]
        u = (Y @ x[:, :, None])[:, :, 0] / beta[:, None]
        return ScaledBound(beta, u, u, x, x, np.zeros_like(F))
    twisted = np.zeros((len(Y), r, r), complex)
    twisted[:, into] = 1j * F[:, :, None] * Y[:, out]
    H = np.zeros((len(Y), r + c, r + c), complex)
    H[:, :r, :r] = twisted + twisted.conj().mT
    H[:, :r, r:], H[:, r:, :r] = adjoint, Y
    values, vectors = np.linalg.eigh(H)
    beta, x, y = values[:, -1], vectors[:, :r, -1], vectors[:, r:, -1]
    # the change is 2 Re (y^H + j x^H F) dY x + 2 Re j x^H dF Y x
    w = y.copy()
    w[:, out] -= 1j * F * x[:, into]
    Yx, wY = (Y @ x[:, :, None])[:, :, 0], (adjoint @ w[:, :, None])[:, :, 0]
    half = 2 / beta[:, None]
    by_turn = half * (1j * x[:, into].conj() * Yx[:, out]).real
    return ScaledBound(beta, half * Yx, w, half * x, wY, by_turn)
