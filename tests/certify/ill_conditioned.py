"""Ill-conditioned realisations whose transfer functions are known exactly.

Lightly damped modal systems of small integers and dyadic damping are transformed by similarities
that are integer matrices with integer inverses. Every entry is computed in rational arithmetic, and
only systems are taken whose entries are doubles.
"""

from dataclasses import dataclass
from fractions import Fraction

import control
import numpy as np
from flint import acb, acb_mat, ctx


@dataclass
class IllConditioned:
    """The transformed system, its modal parts, and the condition of the similarity.

    ``residues`` (m, c, r) belong to the poles -damping + j omega; there are the conjugates besides.
    """

    system: control.StateSpace
    damping: float
    omega: np.ndarray
    residues: np.ndarray
    D: np.ndarray
    condition: float


def ill_conditioned(seed):
    """A random system of the family: 2 to 20 states, damping 1e-2 to 1e-9, condition 1 to 1e8."""
    rng = np.random.default_rng(seed)
    while True:
        m = int(rng.integers(1, 11))
        goal = 10 ** rng.uniform(0, 8)
        r, c = (1 if rng.random() < 0.6 else int(rng.integers(2, 4)) for _ in range(2))
        damping = Fraction(int(rng.integers(1, 4)), 2 ** int(rng.integers(7, 31)))
        omega = rng.choice(np.arange(1, 60), m, replace=False)
        A = np.zeros((2 * m, 2 * m), dtype=object)
        for k, w in enumerate(omega.tolist()):
            A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[-damping, w], [-w, -damping]]
        B, C = rng.integers(-3, 4, (2 * m, r)), rng.integers(-3, 4, (c, 2 * m))
        D = rng.integers(-2, 3, (c, r)).astype(float)
        T, inverse = (
            np.eye(2 * m, dtype=int).astype(object),
            np.eye(2 * m, dtype=int).astype(object),
        )
        size = int(rng.choice([1, 2, 5, 20, 100]))
        for _ in range(int(rng.integers(0, 4 * m + 1))):
            i, j = rng.choice(2 * m, 2, replace=False)
            factor = int(rng.integers(1, size + 1)) * int(rng.choice([-1, 1]))
            T[i] = T[i] + factor * T[j]
            inverse[:, j] = inverse[:, j] - factor * inverse[:, i]
        condition = float(np.linalg.norm(T.astype(float), 2))
        condition *= float(np.linalg.norm(inverse.astype(float), 2))
        if not goal / 5 < condition < min(5 * goal, 2e8):
            continue
        exact = T @ A @ inverse, T @ B.astype(object), C.astype(object) @ inverse
        doubles = [part.astype(float) for part in exact]
        same = all(
            Fraction(one) == other
            for part, its in zip(doubles, exact, strict=True)
            for one, other in zip(part.ravel().tolist(), its.ravel().tolist(), strict=True)
        )
        if same:
            break
    into = (B[0::2] - 1j * B[1::2]) / 2  # the projection on the eigenvector (1, j)
    residues = np.einsum("ck,kr->kcr", C[:, 0::2] + 1j * C[:, 1::2], into)
    system = control.ss(*doubles, D)
    return IllConditioned(system, float(damping), omega, residues, D, condition)


def known_peak(case):
    """A frequency near the peak's, and the largest singular value there in ball arithmetic.

    It is the peak up to the resolution of a search over the modal sums: offsets from each resonance
    are exact, so that these round little.
    """
    best, place = -1.0, (0.0, 0.0)
    starts = [(float(w), 30 * case.damping) for w in case.omega]
    for centre, half in [*starts, (0.0, 80.0)]:
        middle = 0.0
        for _ in range(12 if centre else 3):
            offset = middle + half * np.linspace(-1, 1, 401 if centre else 8001)
            offset = offset if centre else np.abs(offset)
            gain = np.linalg.norm(_response(case, centre, offset), 2, axis=(1, 2))
            if gain.max() > best:
                best, place = float(gain.max()), (centre, float(offset[gain.argmax()]))
            middle, half = float(offset[gain.argmax()]), half / 100
    direct = float(np.linalg.norm(case.D, 2))
    return max(_gain_in_balls(case, *place), direct * (1 - 1e-12))


def _response(case, centre, offset):
    """Responses at centre + offset (F,)."""
    M = np.tile(case.D.astype(complex), (len(offset), 1, 1))
    for w, residue in zip(case.omega.tolist(), case.residues, strict=True):
        for pole, part in ((w, residue), (-w, residue.conj())):
            s = case.damping + 1j * ((centre - pole) + offset)
            M += part / s[:, None, None]
    return M


def _gain_in_balls(case, centre, offset):
    """A number just below the largest singular value at one frequency, by 300 bits."""
    old, ctx.prec = ctx.prec, 300
    try:
        A, B, C, D = (
            acb_mat(*part.shape, [acb(float(x)) for x in part.ravel()])
            for part in (case.system.A, case.system.B, case.system.C, case.system.D)
        )
        jw = acb(0, 1) * (acb(centre) + acb(offset))
        resolvent = acb_mat(case.system.nstates, case.system.nstates)
        for k in range(case.system.nstates):
            resolvent[k, k] = jw
        M = D + C * (resolvent - A).solve(B)
        midpoints = [complex(entry.mid()) for entry in M.entries()]
        assert all(float(entry.rad()) < 1e-30 * (1 + abs(entry)) for entry in M.entries())
    finally:
        ctx.prec = old
    return float(np.linalg.norm(np.reshape(midpoints, case.D.shape), 2)) * (1 - 1e-13)
