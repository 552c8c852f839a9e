"""A lower bound of the worst cost of any spectrum, by duality."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray

DIRECTIONS = 12
"""Directions of the plane of each watched frequency."""


def least_cost_bound(
    M: RealArray, information: RealArray, planes: RealArray, uses: RealArray
) -> float:
    """A lower bound of the worst cost of any powers q >= 0 with uses q <= 1; 0: none is found.

    For V = sum_j w_j h_j h_j' with weights w of sum 1 over directions h of watched planes, and
    N = M^-1 V M^-1 at some powers, every q within the limits has a worst cost of at least
    tr(V M(q)^-1) >= tr(V M^-1)^2 / tr(M(q) N) (Cauchy and Schwarz). A linear program chooses the
    weights; the bound is tight where the powers are the best ones.

    Parameters
    ----------
    M
        Information (P, P) of some powers, regular.
    information
        M_k (K, P, P) of unit powers.
    planes
        root(c) [Re g, Im g] (W, P, 2) of the watched frequencies.
    uses
        Shares (R, K) of the limits.
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
    # Of tr(V M^-1) = 1 in units of the largest size, the product of sum(w) and sum(y),
    # uses' y >= gains w, is to be least; near the best powers each of them is 1.
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
    # Whatever the solver did: y raised until it holds every line.
    largest = float(y.sum() * np.max(gains @ w / used))
    return float(unit * (size @ w) ** 2 / (largest * w.sum()))
