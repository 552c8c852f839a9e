"""Hankel singular values of stable systems, each enclosed.

They are the square roots of the eigenvalues of P Q, where P and Q are the Gramians. Let P be near S
S' with a difference between -F and F, and Q near M with a difference between -H and H. By the
monotonicity of eigenvalues, those of P Q are those of S' M S up to the largest eigenvalues of F Q
and of S' H S. By the quantitative law of inertia (A. Ostrowski, A quantitative formulation of
Sylvester's law of inertia, Proc. Nat. Acad. Sci. 45 (1959) 740-744) the eigenvalues of V' (S' M S)
V are those of S' M S, each times a number between the least and the largest eigenvalue of V'V; V is
a product of rotations that makes the matrix nearly diagonal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx

from workbench._core.arrays import EPS, RealArray
from workbench.certify.balls import above, below
from workbench.certify.modes.modal_form import real_balls
from workbench.certify.realisations.lyapunov import EnclosedGramian, enclosed_gramian, frobenius
from workbench.systems.balancing import with_state_units

BITS = (128, 256, 512, 1024)
"""Bits of the numbers, tried in turn until the values are accurate. Each doubling squares what may
cancel. With half of all more values have wide intervals; double takes longer.
"""
SHARP = 1e-9
"""An interval of this relative width is accurate enough. Half or double changes the precision that
is tried last.
"""
MOST_SWEEPS = 40
"""Largest number of sweeps of rotations; they converge quadratically. They end earlier once nothing
is turned. With half of them, values of ill-conditioned systems may have wide intervals; double
changes nothing.
"""


def enclosed_hankel_values(
    A: RealArray, B: RealArray, C: RealArray, dt: float
) -> tuple[RealArray, RealArray] | None:
    """Lower and upper bounds of the Hankel singular values (n,) of a stable system, falling.

    None if the Gramians cannot be computed, because poles are too near the boundary of stability.
    """
    if not len(A):
        return np.zeros(0), np.zeros(0)
    A, B, C, _ = with_state_units(A, B, C, np.zeros((len(C), B.shape[1])))
    found = None
    for bits in BITS:
        gramians = [enclosed_gramian(A, B, dt, bits), enclosed_gramian(A.T, C.T, dt, bits)]
        P, Q = gramians
        if P is None or Q is None:
            continue
        with ctx.workprec(bits):
            found = _values(P, Q, bits)
        lower, upper = found
        wide = upper - lower > SHARP * upper
        if not (wide & (upper > EPS * upper[0])).any():
            break
    return found


def _values(P: EnclosedGramian, Q: EnclosedGramian, bits: int) -> tuple[RealArray, RealArray]:
    """Bounds of the values from enclosed Gramians."""
    n = P.middle.nrows()
    S = _factor(P.middle, bits)
    blur = frobenius(P.middle - S * S.transpose())
    size = frobenius(Q.middle) + Q.share * frobenius(Q.size)
    error = (P.share * frobenius(P.size) + blur) * size
    error += Q.share * frobenius(S.transpose() * Q.size * S)
    middles, radius, turn = _eigenvalues(S.transpose() * Q.middle * S, bits)
    squares = [((each - radius) / (1 + turn), (each + radius) / (1 - turn)) for each in middles]
    squares += [(arb(0), arb(0))] * (n - len(squares))
    lower = np.array([below((low - error).lower().max(arb(0)).sqrt()) for low, _ in squares])
    upper = np.array([above((high + error).upper().max(arb(0)).sqrt()) for _, high in squares])
    return np.sort(np.maximum(lower, 0.0))[::-1], np.sort(upper)[::-1]


def _factor(P: Any, bits: int) -> Any:
    """S (n, r) with P near S S', by Cholesky's method with the largest pivot first."""
    n = P.nrows()
    rest = P.tolist()
    columns: list[list[arb]] = []
    least = max((abs(rest[k][k]) for k in range(n)), default=arb(0)) * arb(2) ** -bits
    for _ in range(n):
        pivot = max(range(n), key=lambda k: rest[k][k])
        if not rest[pivot][pivot] > least:
            break
        root = rest[pivot][pivot].sqrt()
        column = [(entry / root).mid() for entry in rest[pivot]]
        columns.append(column)
        for i in range(n):
            for j in range(n):
                rest[i][j] = (rest[i][j] - column[i] * column[j]).mid()
    return arb_mat(len(columns), n, [entry for column in columns for entry in column]).transpose()


def _eigenvalues(M: Any, bits: int) -> tuple[list[arb], arb, arb]:
    """Approximate eigenvalues of a symmetric M, their distance from the true ones, and that of V'V
    from 1.
    """
    r = M.nrows()
    if not r:
        return [], arb(0), arb(0)
    scale = max(abs(M[k, k]) for k in range(r)).mid()
    near = np.array([float((entry / scale).mid()) for entry in M.entries()]).reshape(r, r)
    V = real_balls(np.linalg.eigh((near + near.T) / 2)[1])
    V = _rotated((V.transpose() * M * V).mid(), V, bits)
    diagonal = V.transpose() * M * V
    turn = frobenius(V.transpose() * V - real_balls(np.eye(r)))
    middles = [diagonal[k, k].mid() for k in range(r)]
    for k in range(r):
        diagonal[k, k] -= middles[k]
    return middles, frobenius(diagonal), turn


def _rotated(M: Any, V: Any, bits: int) -> Any:
    """V times rotations that make M nearly diagonal (Jacobi's method), using midpoints only."""
    r = M.nrows()
    rows, frame = M.tolist(), V.transpose().tolist()
    least = max(abs(rows[k][k]) for k in range(r)) * arb(2) ** (4 - bits)
    for _ in range(MOST_SWEEPS):
        turned = False
        for p in range(r - 1):
            for q in range(p + 1, r):
                if not abs(rows[p][q]) > least:
                    continue
                turned = True
                half = (rows[q][q] - rows[p][p]) / (2 * rows[p][q])
                tangent = 1 / (abs(half) + (1 + half * half).sqrt())
                tangent = -tangent if half < 0 else tangent
                c = (1 / (1 + tangent * tangent).sqrt()).mid()
                s = (tangent * c).mid()
                _turn(rows, p, q, c, s)
                for row in rows:
                    row[p], row[q] = (
                        (c * row[p] - s * row[q]).mid(),
                        (s * row[p] + c * row[q]).mid(),
                    )
                _turn(frame, p, q, c, s)
        if not turned:
            break
    return arb_mat(frame).transpose()


def _turn(rows: list[list[arb]], p: int, q: int, c: arb, s: arb) -> None:
    """Rotate two rows."""
    pairs = list(zip(rows[p], rows[q], strict=True))
    rows[p] = [(c * one - s * other).mid() for one, other in pairs]
    rows[q] = [(s * one + c * other).mid() for one, other in pairs]
