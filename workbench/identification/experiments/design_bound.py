"""A lower bound of the worst cost of any spectrum, by duality."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray

DIRECTIONS = 12
"""Number of directions in the plane of each watched frequency."""


def least_cost_bound(
    M: RealArray, information: RealArray, planes: RealArray, uses: RealArray
) -> float:
    """Lower bound of the worst cost of any powers q >= 0 with uses q <= 1; 0 if none is found.

    For V = sum_j w_j h_j h_j' with weights w of sum 1 over directions h of watched planes, and N =
    M^-1 V M^-1 at some powers, every q within the limits has a worst cost of at least tr(V M(q)^-1)
    >= tr(V M^-1)^2 / tr(M(q) N) (Cauchy and Schwarz). A linear program chooses the weights; the
    bound is tight at the optimal powers.

    Parameters
    ----------
    M
        Information (P, P) of some powers; it must be regular.
    information
        M_k (K, P, P) of unit powers.
    planes
        root(c) [Re g, Im g] (W, P, 2) of the watched frequencies.
    uses
        Fractions (R, K) of the limits that a unit of power uses.
    """
    from scipy.optimize import linprog

    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = planes @ np.stack([np.cos(angle), np.sin(angle)])
    steepest = np.linalg.eigh(planes.mT @ np.linalg.solve(M, planes))[1][:, :, -1:]
    h = np.concatenate([ways, planes @ steepest], axis=-1)
    h = h.transpose(0, 2, 1).reshape(-1, len(M))
    moved = np.linalg.solve(M, h.T).T
    size = np.sum(h * moved, axis=1)
    unit = size.max()
    gains = np.einsum("ji,kil,jl->kj", moved, information, moved) / unit
    size = size / unit
    # Scale the weights so that tr(V M^-1) = 1 in units of the largest size. The product of sum(w)
    # and sum(y), with uses' y >= gains w, is minimised; near the optimal powers both sums are 1.
    limits, lines = uses.shape
    found = linprog(
        np.ones(limits + len(h)),
        A_ub=np.hstack([-uses.T, gains]),
        b_ub=np.zeros(lines),
        A_eq=np.concatenate([np.zeros(limits), size])[None],
        b_eq=[1.0],
    )
    if found.x is None:
        return 0.0
    y, w = (np.maximum(part, 0.0) for part in np.split(found.x, [limits]))
    used = uses.T @ y
    if not (w.any() and (used > 0).all()):
        return 0.0
    # Whatever the solver returned: raise y until every line's inequality holds.
    largest = float(y.sum() * np.max(gains @ w / used))
    return float(unit * (size @ w) ** 2 / (largest * w.sum()))
