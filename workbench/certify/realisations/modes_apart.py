"""The gain of the difference of two stable systems, mode by mode, where their poles nearly agree.

Let poles p and q, with residues R and S, differ by rounding only. Eigenvectors of both systems
together cannot separate them. The modes of each system alone are enclosed in balls, and

    R / (s - p) - S / (s - q) = (R - S) / (s - p) + S (p - q) / ((s - p) (s - q))

is at most |R - S| / d_p + |S| |p - q| / (d_p d_q) on the boundary of stability, at the distances
d_p and d_q from the poles.
"""

from __future__ import annotations

import math
from typing import Any

from flint import acb_mat, arb, ctx

from workbench.certify.balls import above, balls
from workbench.certify.rounding import BALL_BITS
from workbench.systems.realisation import Matrices

Mode = tuple[Any, acb_mat]
"""A pole and its residue, in balls."""


def gain_by_modes(one: Matrices, other: Matrices, sampled: bool) -> float:
    """A bound of the largest gain of the difference of two stable systems.

    Infinite if poles of one system cannot be told from each other, or from the boundary. The bound
    is close to the gain itself if it comes from few modes that nearly agree.
    """
    with ctx.workprec(BALL_BITS):
        modes, others = (_modes(part) for part in (one, other))
        if modes is None or others is None:
            return math.inf
        total = _size(balls(one[3]) - balls(other[3]))
        for pole, residue in modes:
            away = _distance(pole, sampled)
            near = min(others, key=lambda mode: float(abs(mode[0] - pole).mid()), default=None)
            apart = None if near is None else abs(near[0] - pole)
            if near is None or apart is None or not apart < away:
                total += _size(residue) / away
                continue
            others.remove(near)
            total += _size(residue - near[1]) / away
            total += _size(near[1]) * apart / (away * _distance(near[0], sampled))
        total += sum((_size(R) / _distance(pole, sampled) for pole, R in others), arb(0))
        return above(total)


def _modes(part: Matrices) -> list[Mode] | None:
    """Poles and residues; None if poles cannot be told from each other."""
    A, B, C, _ = map(balls, part)
    n = A.nrows()
    if not n:
        return []
    try:
        poles, V = A.eig(right=True)
        W = V.inv()
    except (ValueError, ZeroDivisionError):
        return None
    out, into = C * V, W * B
    return [(poles[k], _dyad(out, into, k)) for k in range(n)]


def _dyad(out: acb_mat, into: acb_mat, k: int) -> acb_mat:
    rows, columns = out.nrows(), into.ncols()
    return acb_mat(
        rows, columns, [out[i, k] * into[k, j] for i in range(rows) for j in range(columns)]
    )


def _distance(pole: Any, sampled: bool) -> arb:
    """Distance of a stable pole from the boundary; a ball that contains 0 makes the bound
    infinite.
    """
    away: arb = 1 - abs(pole) if sampled else -pole.real
    return away if away > 0 else arb(0)


def _size(matrix: acb_mat) -> arb:
    """An upper bound of the norm; a ball that contains 0 has no root."""
    squares = sum((abs(entry) ** 2 for entry in matrix.entries()), arb(0))
    return squares.abs_upper().sqrt()
