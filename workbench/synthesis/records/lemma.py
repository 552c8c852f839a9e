"""The matrix S-lemma as a proof: one quadratic matrix inequality implies another.

The plants theta = centre + delta H of the records obey [I delta] N [I delta]' >= 0. All of them
obey

    shrunk - A_K (Y^-1 - C_K' C_K)^-1 A_K' > 0,    A_K = theta [I; K],    C_K = C + D K,

where "shrunk" is Y less a term that depends on the claim, if for some alpha, with A_0 = centre [I;
K],

    [shrunk     0          A_0 Y      0      ]
    [0          0          H [I; K] Y 0      ]  -  alpha [N 0; 0 0]  >  0.
    [Y A_0'     Y [I K'] H'  Y        Y C_K' ]
    [0          0          C_K Y      I      ]

Source: that of `workbench.synthesis.records.record`, theorems 13, 14, 17 and 20, in coordinates
about the centre. All matrices are enclosed, so the proof holds exactly for the given doubles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.rounding import (
    TINY,
    UPWARD,
    Enclosure,
    exact,
    nearest_power_of_two,
    positive_definite,
    solution,
    stacked_enclosures,
)
from workbench.synthesis.records.record import StateRecords

PROVEN_SHARES = (0.9, 0.5, 0.0)
"""Shares of the computed least eigenvalue, tried as proven lower bounds."""


def proven_least_eigenvalue(matrix: Enclosure, starts: Sequence[int]) -> float:
    """Lower bound on the least eigenvalue of every symmetric matrix in an enclosure, after scaling.

    The scaled matrix is F = X' M X, where X is any regular matrix that makes its diagonal blocks
    almost the identity. The blocks begin at the ``starts``. The bound is not above 0 where nothing
    is proven.
    """
    diagonal = np.diagonal(matrix.mid)
    if not (matrix.finite and (diagonal > 0).all()):
        return -math.inf
    X = np.zeros(matrix.mid.shape)
    for low, high in pairwise((*starts, len(X))):
        part, size = matrix.mid[low:high, low:high], np.sqrt(diagonal[low:high])
        try:
            root = np.linalg.cholesky(part / size[:, None] / size)
            X[low:high, low:high] = np.linalg.inv(root).T / size[:, None]
        except np.linalg.LinAlgError:
            return -math.inf
    scaled = exact(X.T) @ (matrix @ exact(X))
    least = float(np.linalg.eigvalsh((scaled.mid + scaled.mid.T) / 2)[0])
    for share in PROVEN_SHARES if least > 0 else ():
        if positive_definite(scaled - exact(share * least * np.eye(len(X)))):
            return max(share * least, TINY)
    return min(least, 0.0)


def implication(
    records: StateRecords,
    K: RealArray,
    Y: RealArray,
    multiplier: float,
    shrunk: Enclosure,
    C: RealArray,
    D: RealArray,
) -> Enclosure:
    """Enclosure of the matrix above, for K (m, n), Y (n, n), alpha, and the shrunk Y (n, n).

    C (p, n) and D (p, m) define the performance output; p may be 0.
    """
    n, p, total = records.order, len(C), records.order + records.controls
    one = exact(Y)
    both = stacked_enclosures([[one], [exact(K) @ one]])
    moved, beside = exact(records.centre) @ both, exact(records.frame) @ both
    seen = exact(C) @ one + exact(D) @ (exact(K) @ one)
    zero = [[exact(np.zeros((a, b))) for b in (n, total, n, p)] for a in (n, total, n, p)]
    N = records.inequality.times(multiplier)
    corner, across, low = _blocks_of(N, n)
    return stacked_enclosures(
        [
            [shrunk - corner, -across, moved, zero[0][3]],
            [-across.H, -low, beside, zero[1][3]],
            [moved.H, beside.H, one, seen.H],
            [zero[3][0], zero[3][1], seen, exact(np.eye(p))],
        ]
    )


def _blocks_of(N: Enclosure, n: int) -> tuple[Enclosure, Enclosure, Enclosure]:
    """The blocks N_11, N_12 and N_22."""
    return (
        Enclosure(N.mid[:n, :n], N.rad[:n, :n]),
        Enclosure(N.mid[:n, n:], N.rad[:n, n:]),
        Enclosure(N.mid[n:, n:], N.rad[n:, n:]),
    )


def trace_of_cost(Y: RealArray, F: RealArray) -> float:
    """Upper bound on the trace of F' Y^-1 F; infinite where Y is not proven to be positive
    definite.
    """
    factor = 1.0 / nearest_power_of_two(np.sqrt(np.abs(np.diagonal(Y))))
    scaled = exact(Y).scaled(factor, factor)
    if not positive_definite(scaled):
        return math.inf
    inner = solution(scaled, exact(F).scaled(factor, np.ones(F.shape[1])))
    if inner is None:
        return math.inf
    cost = exact(F.T).scaled(np.ones(F.shape[1]), factor) @ inner
    return float(np.diagonal(cost.mid + cost.rad).sum()) * UPWARD
