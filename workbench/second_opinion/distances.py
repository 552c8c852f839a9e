"""Distances between plants in closed loop, by formulas for their responses."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.second_opinion.responses import plain_response


def chordal_distance(first: Any, second: Any, omega: RealArray) -> RealArray:
    """Chordal distance (F,) of two plants at `omega` [rad/s] (F,).

    The largest singular value of (I + P2 P2*)^-1/2 (P1 - P2) (I + P1* P1)^-1/2 (Vinnicombe 2001,
    definition 3.1).
    """
    P1, P2 = plain_response(first, omega), plain_response(second, omega)
    left = _inverse_root(P2 @ _adjoint(P2))
    found: RealArray = np.linalg.norm(
        left @ (P1 - P2) @ _inverse_root(_adjoint(P1) @ P1), 2, axis=(-2, -1)
    )
    return found


def loop_distance(plant: Any, controller: Any, omega: RealArray) -> RealArray:
    """Reciprocal (F,) of the largest singular value of [I; P] (I + K P)^-1 [I K]."""
    P, K = plain_response(plant, omega), plain_response(controller, omega)
    m = P.shape[2]
    unit = np.broadcast_to(np.eye(m), (len(omega), m, m))
    inner = np.linalg.solve(unit + K @ P, np.concatenate([unit, K], axis=2))
    whole = np.concatenate([unit, P], axis=1) @ inner
    found: RealArray = 1.0 / np.linalg.norm(whole, 2, axis=(-2, -1))
    return found


def _adjoint(M: ComplexArray) -> ComplexArray:
    return M.conj().swapaxes(-1, -2)


def _inverse_root(M: ComplexArray) -> ComplexArray:
    """(I + M)^-1/2 of positive semidefinite matrices (F, n, n)."""
    values, vectors = np.linalg.eigh(np.eye(M.shape[-1]) + M)
    return (vectors / np.sqrt(values)[:, None, :]) @ _adjoint(vectors)
