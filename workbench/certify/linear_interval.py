"""The interval on which multipliers that change linearly with frequency prove a bound of mu.

In a loop that H-infinity synthesis made, mu is nearly constant over frequency, but the multipliers
that prove it are not; fixed multipliers then hold on short intervals only. Consider the interval
from w0 - h to w0 + h. The substitution s = j w0 + h / z turns D(w) = D_0 + D_1 (w - w0) / h into

    D(w) = D_0 - j D_1 / z,

which is proper in z. With x the state of Y, z p = Y u and z q = u, the form u^H Phi(w) u of
`workbench.certify.interval` is a quadratic form of (x, p, q, u), which is a Popov function again.
Phi is singular exactly where z is an imaginary eigenvalue of the Hamiltonian of this function, and
the interval is |z| > 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.certify.interval import (
    ABSOLUTE_REAL_PART,
    END_MARGIN,
    RELATIVE_REAL_PART,
    Frame,
    StableSystem,
    frame_of,
    positive,
)

MultiplierTriple = Sequence[Array]
"""D_left, D_right and G."""


def certified_between(
    system: StableSystem,
    middle: MultiplierTriple,
    change: MultiplierTriple,
    beta: float,
    omega: float,
    half: float,
) -> tuple[float, float] | None:
    """The interval around `omega`, within `half` of it, on which linear multipliers prove `beta`.

    Parameters
    ----------
    middle, change
        D_left (c, c), D_right (r, r) and G (r, c) are middle + change (w - omega) / half, both D
        positive definite where |w - omega| <= half.
    beta
        The bound, positive.
    omega, half
        Middle and half-width [rad/s], positive, half no larger than omega.

    Returns
    -------
    (low, high); None where the multipliers do not prove beta at `omega`, or where samples
    contradict the proof.
    """
    frame = frame_of(middle[0], middle[1], middle[2], beta)
    if frame is None:
        return None
    H = _hamiltonian(system, frame, change, beta, omega, half)
    if H is None:
        return None
    z = np.linalg.eigvals(H)
    limit = RELATIVE_REAL_PART * np.abs(z) + ABSOLUTE_REAL_PART * float(np.linalg.norm(H))
    ends = []
    for sign in (-1.0, 1.0):  # (w - omega) / half = -1 / Im z
        size = float((-sign * z.imag[np.abs(z.real) <= limit]).max(initial=0.0))
        ends.append(omega + sign * half * (1.0 if size < 1.0 else (1 - END_MARGIN) / size))
    suspects = z[np.abs(z.real) < 0.3 * np.abs(z)].imag
    inside = omega - half / suspects[np.abs(suspects) > 1.0]
    known = np.unique([*ends, omega, *inside[(inside > ends[0]) & (inside < ends[1])]])
    points = np.concatenate([known, (known[1:] + known[:-1]) / 2])
    right = frame.right
    for w, M in zip(points, system.response(points), strict=True):
        D_l, D_r, G = (m + d * (w - omega) / half for m, d in zip(middle, change, strict=True))
        twisted = 1j * (G @ M)
        Phi = beta**2 * D_r - M.conj().T @ D_l @ M - twisted - twisted.conj().T
        if not positive(right.conj().T @ Phi @ right):
            return None
    return ends[0], ends[1]


def _hamiltonian(
    system: StableSystem,
    frame: Frame,
    change: MultiplierTriple,
    beta: float,
    omega: float,
    half: float,
) -> Array | None:
    """The Hamiltonian whose imaginary eigenvalues are the z at which Phi is singular.

    None where Phi is not positive at `omega`, or where entries overflow. Arguments as
    `certified_between`.
    """
    c, r = system.D.shape
    inverse = np.linalg.inv(system.A - 1j * omega * np.eye(len(system.A)))
    left, X = frame.left, frame.right
    back = np.linalg.inv(left) / beta
    # E_y, E_p, E_q and E_u map (x, p, q, u) to Y u, (w - omega) / half Y u, the same of u, and u.
    A, B = half * inverse, -half * inverse @ system.B @ X
    C, D = left @ system.C @ inverse, left @ (system.D - system.C @ inverse @ system.B) @ X
    n = len(A)
    states = n + c + r
    E_y = np.hstack([C, np.zeros((c, c + r)), D])
    E_p = np.hstack([np.zeros((c, n)), -1j * np.eye(c), np.zeros((c, 2 * r))])
    E_q = np.hstack([np.zeros((r, n + c)), -1j * np.eye(r), np.zeros((r, r))])
    E_u = np.hstack([np.zeros((r, states)), np.eye(r)])
    L_1 = back.conj().T @ change[0] @ back
    R_1 = X.conj().T @ change[1] @ X
    G_1 = X.conj().T @ change[2] @ back / beta
    half_form = (
        0.5 * E_u.conj().T @ frame.E @ E_u
        + 0.5 * E_u.conj().T @ R_1 @ E_q
        - 0.5 * E_y.conj().T @ (E_y + L_1 @ E_p)
        - 1j * E_u.conj().T @ (frame.F @ E_y + G_1 @ E_p)
    )
    form = half_form + half_form.conj().T
    Q, S, R = form[:states, :states], form[:states, states:], form[states:, states:]
    if not (np.isfinite(form).all() and positive(R)):
        return None
    A = np.block([[A, np.zeros((n, c + r))], [C, np.zeros((c, c + r))], [np.zeros((r, states))]])
    B = np.vstack([B, D, np.eye(r)])
    feedback = np.linalg.solve(R, np.hstack([S.conj().T, B.conj().T]))
    corner = A - B @ feedback[:, :states]
    return np.block(
        [
            [corner, -B @ feedback[:, states:]],
            [S @ feedback[:, :states] - Q, -corner.conj().T],
        ]
    )
