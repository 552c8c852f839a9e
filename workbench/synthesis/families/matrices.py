"""Responses of controllers whose matrices are functions of parameters."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.systems.realisation import Matrices


def matrix_slopes(
    matrices: Matrices, slopes: Matrices, omega: RealArray
) -> tuple[ComplexArray, ComplexArray]:
    """K (F, p, m) at omega (F,) [rad/s], and its derivatives (F, k, p, m) by k parameters.

    `slopes` are the derivatives (k, ...) of A, B, C and D.
    """
    (A, B, C, D), (dA, dB, dC, dD) = matrices, slopes
    resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(len(A)) - A)
    into, out = resolvent @ B, C @ resolvent
    K = np.asarray(out @ B + D, dtype=complex)
    through = out[:, None] @ (dA @ into[:, None] + dB) + dC @ into[:, None] + dD
    return K, np.asarray(through, dtype=complex)
