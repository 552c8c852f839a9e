"""The H-infinity norm by SLICOT, for methods; checks compute it with code of their own."""

from __future__ import annotations

import math

import numpy as np

from workbench.solvers import slicot_routine
from workbench.systems.balancing import balanced
from workbench.systems.realisation import Matrices


def stable(A: np.ndarray) -> bool:
    """Whether every eigenvalue lies left of the imaginary axis by more than rounding."""
    if not len(A):
        return True
    # The scale is that of the modes: the entries of A depend on the units of the states, the modes
    # do not.
    modes = np.linalg.eigvals(A)
    rounding = len(A) * np.finfo(float).eps * float(np.abs(modes).max())
    return bool(modes.real.max() < -rounding)


def hinf_norm(system: Matrices, tolerance: float = 1e-9) -> float:
    """H-infinity norm of a continuous-time realisation; infinite if it is not stable.

    `tolerance` is the relative accuracy. The states are balanced first, because slow modes would be
    lost in the rounding of large entries. Raises SlycotArithmeticError where SLICOT does not
    converge.
    """
    return norm_and_place(system, tolerance)[0]


def norm_and_place(system: Matrices, tolerance: float = 1e-9) -> tuple[float, float]:
    """As `norm`, and the frequency of the norm [rad/s], which may be infinite."""
    ab13dd = slicot_routine("ab13dd")

    D = system[3]
    A, B, C = balanced(*system[:3])
    if not stable(A):
        return math.inf, 0.0
    if not len(A):
        return float(np.linalg.norm(D, 2)), 0.0
    n, m, p = len(A), B.shape[1], len(C)
    size, omega = ab13dd("C", "I", "S", "D", n, m, p, A, np.eye(n), B, C, D, tolerance)
    return float(size), float(omega)
