"""The interval of frequencies on which fixed multipliers prove a bound of mu.

Scale the multipliers to near 1 and let Y be the response M in these coordinates. Then

    Phi(w) = E - Y^H Y - j (F Y - Y^H F^H) > 0        is the same as
    beta^2 D_r - M(jw)^H D_l M(jw) - j (G M(jw) - M(jw)^H G^H) > 0.

Let the inequality hold at a frequency w0. The substitution s = j w0 + 1 / z makes Y(j w0) the
direct term of a system in z, and Phi the Popov function of that system. Phi(w) is then singular
exactly where z = 1 / (j (w - w0)) is an eigenvalue of a Hamiltonian. The frequencies nearest to w0
belong to the largest eigenvalues, which are the most accurate. For w0 at infinity, z is s itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from workbench.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import balancing
from workbench.systems.frequency_response import CHUNK_ENTRIES
from workbench.systems.interconnection import part_of
from workbench.systems.realisation import EPS

RELATIVE_REAL_PART = 1e-6
"""An eigenvalue counts as imaginary if its real part is below this share of its size."""
ABSOLUTE_REAL_PART = 1e3 * EPS
"""An eigenvalue counts as imaginary if its real part is below this share of the Hamiltonian's
norm."""
END_MARGIN = 1e-6
"""Share of the distance to each end that an interval gives up, to allow for rounding."""


@dataclass(frozen=True, eq=False)
class StableSystem:
    """A stable continuous-time system with scaled states; ``poles`` (n,) [rad/s]."""

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    poles: Array

    @property
    def scale(self) -> float:
        """Geometric mean of the sizes of the poles [rad/s]; 1 without poles."""
        return float(np.exp(np.log(np.abs(self.poles)).mean())) if len(self.poles) else 1.0

    def response(self, omega: ArrayLike) -> Array:
        """Frequency response at `omega` [rad/s] (F,), infinity allowed, (F, outputs, inputs)."""
        points = np.atleast_1d(np.asarray(omega, dtype=float))
        result = np.tile(self.D.astype(complex), (len(points), 1, 1))
        n = len(self.A)
        step = max(CHUNK_ENTRIES // max(n * n, 1), 1)
        finite = np.flatnonzero(np.isfinite(points))
        for part in np.split(finite, range(step, len(finite), step)):
            resolvent = 1j * points[part, None, None] * np.eye(n) - self.A
            result[part] += self.C @ np.linalg.solve(resolvent, self.B.astype(complex))
        return result


def stable_system(system: Any) -> StableSystem:
    """The realisation of a stable StateSpace or TransferFunction, with its states scaled.

    Raises
    ------
    InputError
        The system has another type; it is sampled, improper or not finite; or it has a pole on the
        imaginary axis or to the right of it.
    """
    if isinstance(system, StableSystem):
        return system
    import control

    if not isinstance(system, control.StateSpace | control.TransferFunction):
        raise InputError(
            f"a StateSpace or TransferFunction is needed, not {type(system).__name__}; fit "
            "measured responses first"
        )
    part = part_of(system)
    if part.dt:
        raise InputError(
            f"the system is sampled every {part.dt} s, and a continuous-time one is needed; the "
            "bilinear transformation keeps its values, only not their frequencies"
        )
    if not np.isfinite(part.M).all():
        raise InputError("the system has entries that are not finite")
    n = part.states
    scale = balancing(part.M, n)[0][:n]
    A = part.M[:n, :n] * scale[:, None] / scale
    poles = np.linalg.eigvals(A).astype(complex)
    rounding = EPS * max(n, 1) * float(np.linalg.norm(A))
    bad = poles[poles.real >= -rounding]
    if len(bad):
        pole = bad[np.argmax(bad.real)]
        place = (
            "is unstable: it has the pole"
            if pole.real > rounding
            else "has a pole that cannot be told from the imaginary axis:"
        )
        raise InputError(
            f"the system {place} {pole:.6g} rad/s, and bounds over frequency say "
            "nothing of it then; close the loop with a stabilising controller, or move an "
            "integrator a little to the left"
        )
    B, C = part.M[:n, n:] * scale[:, None], part.M[n:, :n] / scale
    return StableSystem(A, B, C, part.M[n:, n:], poles)


def certified_interval(
    system: Any, D_left: Array, D_right: Array, G: Array, beta: float, omega: float
) -> tuple[float, float] | None:
    """The interval of frequencies around `omega` on which the multipliers prove the bound `beta`.

    Parameters
    ----------
    system
        Stable continuous-time system with c outputs and r inputs.
    D_left, D_right, G
        Multipliers (c, c), (r, r), (r, c) as `upper_bound` gives them, D positive definite.
    beta
        The bound, positive.
    omega
        Frequency [rad/s]; 0 and infinity are allowed.

    Returns
    -------
    (low, high) within [0, inf]; None where the multipliers do not prove beta at `omega`, or where
    samples in the interval contradict the proof. Eigenvalues near the imaginary axis count as
    imaginary.

    Raises
    ------
    InputError
        As `stable_system`.

    References
    ----------
    Boyd, Balakrishnan, Kabamba, A bisection method for computing the H-infinity norm of a transfer
    matrix, Math. Control Signals Systems 2 (1989) 207-219, for D = 1 and G = 0.
    """
    system = stable_system(system)
    frame = frame_of(D_left, D_right, G, beta)
    if frame is None:
        return None
    about = _about(system, omega)
    H = _hamiltonian(*about, frame)
    if H is None:
        return None
    z = np.linalg.eigvals(H)
    largest = float(np.abs(H).max(initial=0.0))
    limit = RELATIVE_REAL_PART * np.abs(z) + ABSOLUTE_REAL_PART * largest * float(
        np.linalg.norm(H / (largest or 1.0))
    )
    crossing = z.imag[np.abs(z.real) <= limit]
    low, high = _ends(crossing, omega)
    suspects = _frequencies(z[np.abs(z.real) < 0.3 * np.abs(z)].imag, omega)
    scale = omega if 0.0 < omega < math.inf else system.scale
    points = _between(suspects, low, high, omega, scale)
    if not all(positive(Phi) for Phi in _values(system.response(points), frame)):
        return None
    return low, high


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates with multipliers near 1: Y = left M right, and the matrices E and F of Phi."""

    left: Array
    right: Array
    E: Array
    F: Array


def frame_of(D_left: Array, D_right: Array, G: Array, beta: float) -> Frame | None:
    """The coordinates in which D is 1 and G at most 1; None where D is not positive definite."""
    try:
        left = np.linalg.cholesky(D_left).conj().T
        right = np.linalg.cholesky(D_right).conj().T
        back = _solve(right, np.eye(len(right)))
        twist = back.conj().T @ G @ _solve(left, np.eye(len(left))) / beta
        bound = np.linalg.cholesky(np.eye(len(right)) + twist @ twist.conj().T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    shrink = _solve(bound, np.eye(len(bound)), lower=True)
    return Frame(left / beta, back @ shrink.conj().T, shrink @ shrink.conj().T, shrink @ twist)


def _solve(triangle: Array, other: Array, lower: bool = False) -> Array:
    """Solution X of triangle X = other."""
    return solve_triangular(triangle, other, lower=lower)


def _values(M: Array, frame: Frame) -> Array:
    """Phi for responses M (..., c, r)."""
    Y = frame.left @ M @ frame.right
    twisted = 1j * (frame.F @ Y)
    return frame.E - Y.conj().mT @ Y - twisted - twisted.conj().mT


def positive(Phi: Array) -> bool:
    """Whether Phi > 0, decided by eigenvalues after scaling its diagonal to 1."""
    diagonal = np.diagonal(Phi).real
    if not diagonal.min() > 0:
        return False
    root = diagonal**-0.5
    return bool(np.linalg.eigvalsh(root[:, None] * Phi * root)[0] > 0)


def _about(system: StableSystem, omega: float) -> tuple[Array, Array, Array, Array]:
    """Realisation in z with s = j omega + 1 / z; its direct term is the response at omega."""
    A, B, C, D = system.A, system.B, system.C, system.D
    if math.isinf(omega):
        return A + 0j, B + 0j, C + 0j, D + 0j
    inverse = np.linalg.inv(A - 1j * omega * np.eye(len(A)))
    return inverse, -inverse @ B, C @ inverse, D - C @ inverse @ B


def _hamiltonian(A: Array, B: Array, C: Array, D: Array, frame: Frame) -> Array | None:
    """The Hamiltonian whose imaginary eigenvalues are the z at which Phi is singular.

    None where Phi of the direct term is not positive, or where entries overflow.
    """
    R = _values(D, frame)
    if not positive(R):
        return None
    try:
        root = np.linalg.cholesky(R).conj().T
    except np.linalg.LinAlgError:
        return None
    inverse = _solve(root, np.eye(len(root)))
    C = frame.left @ C
    S = C.conj().T @ (1j * frame.F.conj().T - frame.left @ D @ frame.right) @ inverse
    B = B @ frame.right @ inverse
    corner = A - B @ S.conj().T
    with np.errstate(over="ignore"):
        out, into = C.conj().T @ C + S @ S.conj().T, B @ B.conj().T
    H = np.block([[corner, -into], [out, -corner.conj().T]])
    return H if np.isfinite(H).all() else None


def _frequencies(imaginary: RealArray, omega: float) -> RealArray:
    """Frequencies [rad/s] that belong to imaginary parts of z."""
    if math.isinf(omega):
        return imaginary
    return omega - 1.0 / imaginary[imaginary != 0.0]


def _ends(crossing: RealArray, omega: float) -> tuple[float, float]:
    """Ends of the interval: the nearest crossings on either side of omega, less `END_MARGIN`."""
    if math.isinf(omega):
        return (1 + END_MARGIN) * max(float(crossing.max(initial=0.0)), 0.0), math.inf
    below, above = float(crossing.max(initial=0.0)), -float(crossing.min(initial=0.0))
    low = max(omega - (1 - END_MARGIN) / below, 0.0) if below > 0 else 0.0
    high = omega + (1 - END_MARGIN) / above if above > 0 else math.inf
    return low, high


def _between(suspects: RealArray, low: float, high: float, omega: float, scale: float) -> RealArray:
    """The suspicious frequencies within the interval, and one frequency in each gap between them.

    The frequency in a gap lies in the middle of its ends on the scale arctan(w / scale).
    """
    inside = suspects[(suspects > low) & (suspects < high)]
    known = np.unique([low, high, omega, *inside])
    angle = np.arctan(known / scale)  # finite at infinity
    return np.concatenate([inside, scale * np.tan((angle[1:] + angle[:-1]) / 2)])
