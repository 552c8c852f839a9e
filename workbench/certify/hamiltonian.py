"""Eigenvalues of an interval's Hamiltonian in ball arithmetic, where doubles cannot decide.

`workbench.certify.interval` has the theorem and the Hamiltonian in doubles, which is tried first.

The Hamiltonian is formed from the data in balls and its eigenvalues are enclosed. It may have
simple eigenvalues even if A has multiple ones, as with repeated poles of weights.

Eigenvectors in doubles, improved in balls, make it nearly diagonal. This takes a tenth of the time
of computing its eigenvectors in balls from the start, which is done only if the first way fails.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from flint import acb, acb_mat, ctx

from workbench._core.arrays import Array
from workbench.certify.balls import (
    Matrix,
    above,
    balls,
    doubles,
    identity,
    matrices_in_balls,
    middle,
)
from workbench.certify.eigenvalues import ATTEMPTS, Discs, pencil_discs
from workbench.certify.modes.modal_form import PRECISIONS
from workbench.certify.rounding import in_its_unit
from workbench.certify.stable_system import StableSystem


def ball_discs(
    system: StableSystem, multipliers: Sequence[Array], beta: float, omega: float
) -> Discs | None:
    """Discs that contain all t = w - omega at which Phi(w) is singular; w for omega at infinity.

    None if Phi(omega) > 0 is not proven, or if no precision encloses the eigenvalues. More bits are
    tried as long as a disc that meets the axis is large.

    Parameters
    ----------
    multipliers
        D_left (c, c), D_right (r, r) and G (r, c).
    omega
        Frequency [rad/s] at which Phi must be positive.
    """
    best: Discs | None = None
    for bits in PRECISIONS:
        with ctx.workprec(bits):
            try:
                A, B, C, D = matrices_in_balls(system)
            except ZeroDivisionError:
                continue
            left, right, G = map(balls, multipliers)
            twist = acb(0, -1) * G
            weight = _rows(
                _columns(-left, twist.conjugate().transpose()),
                _columns(twist, right * acb(beta) * acb(beta)),
            )
            found = _discs(A, B, C, D, weight, omega)
        if found is not None:
            best = found
            if not found.doubtful():
                break
    return best


def _discs(A: Matrix, B: Matrix, C: Matrix, D: Matrix, F: Matrix, omega: float) -> Discs | None:
    n, finite = A.nrows(), math.isfinite(omega)
    A = A - acb(0, float(omega)) * identity(n) if finite else A
    try:
        at_omega = D - C * A.solve(B) if finite else D
        if not _positive(_form_of(F, at_omega)):
            return None
        Q, S, R = _blocks(F, C, D)
        back = R.solve(_columns(S.conjugate().transpose(), B.conjugate().transpose()))
        H = _square(A, -Q, -A.conjugate().transpose()) - _rows(B, -S) * back
    except ZeroDivisionError:
        return None
    return _improved_discs(H * acb(0, -1)) or _isolating_discs(H * acb(0, -1))


def _improved_discs(T: Matrix) -> Discs | None:
    """Discs of the pencil W T V - s W V, for eigenvectors V improved in balls and W near V^-1.

    None if a disc that meets the axis stays large.
    """
    try:
        V = balls(np.linalg.eig(in_its_unit(middle(T))[0])[1])
        for _ in range(ATTEMPTS):
            W = V.inv().mid()
            P, E = doubles(W * (T * V)), doubles(W * V)
            found = pencil_discs(P, E)
            if not found.doubtful():
                return found
            V = (V * balls(np.linalg.eig(in_its_unit(P.mid)[0])[1])).mid()
    except (np.linalg.LinAlgError, ZeroDivisionError):
        pass
    return None


def _isolating_discs(T: Matrix) -> Discs | None:
    """One disc for each single eigenvalue; None if the discs cannot be separated."""
    t = T.eig(multiple=True, nonstop=True)
    centre = np.array([complex(one.mid()) for one in t])
    # The centre is rounded to a double as well.
    radius = np.array([above((one - acb(c)).abs_upper()) for one, c in zip(t, centre, strict=True)])
    ok = np.isfinite(centre).all() and np.isfinite(radius).all()
    return Discs(centre, radius) if ok else None


def _form_of(F: Matrix, M: Matrix) -> Matrix:
    """[M; 1]^H F [M; 1]."""
    N = _rows(M, identity(M.ncols()))
    return N.conjugate().transpose() * F * N


def _blocks(F: Matrix, C: Matrix, D: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Q, S and R of the form in the states and inputs."""
    n, r = C.ncols(), D.ncols()
    N = _rows(_columns(C, D), _columns(acb_mat(r, n), identity(r)))
    W = (N.conjugate().transpose() * F * N).tolist()
    return (
        acb_mat([row[:n] for row in W[:n]]),
        acb_mat([row[n:] for row in W[:n]]),
        acb_mat([row[n:] for row in W[n:]]),
    )


def _positive(S: Matrix) -> bool:
    """Whether every pivot of a Hermitian matrix is proven positive."""
    rows = S.tolist()
    for k in range(len(rows)):
        if not rows[k][k].real > 0:
            return False
        for i in range(k + 1, len(rows)):
            ratio = rows[i][k] / rows[k][k].real
            rows[i] = [one - ratio * two for one, two in zip(rows[i], rows[k], strict=True)]
    return True


def _rows(first: Matrix, second: Matrix) -> Matrix:
    return acb_mat([*first.tolist(), *second.tolist()])


def _columns(first: Matrix, second: Matrix) -> Matrix:
    pairs = zip(first.tolist(), second.tolist(), strict=True)
    return acb_mat([[*one, *two] for one, two in pairs])


def _square(first: Matrix, corner: Matrix, second: Matrix) -> Matrix:
    """[first, 0; corner, second]."""
    n = first.nrows()
    return _rows(_columns(first, acb_mat(n, n)), _columns(corner, second))
