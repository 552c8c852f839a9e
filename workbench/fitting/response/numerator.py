"""Numerators of a given degree over given poles, in a basis orthonormal over the data.

Polynomials from Arnoldi's iteration stay well conditioned where powers of s do not: Hokanson, SIAM
J. Sci. Comput. 42(2), 2020, after Brubeck, Nakatsukasa and Trefethen, SIAM Review 63(2), 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.fitting.response.program import ResponseFit


@dataclass(frozen=True)
class NumeratorBasis:
    """Real polynomials in s over a denominator, orthonormal over weighted data.

    Parameters
    ----------
    columns
        Weighted values (2 F, m + 1) of the basis functions, real parts above imaginary parts.
    recurrence
        Matrix (m + 1, m) that multiplies by s: s b_k = sum_j b_j recurrence[j, k].
    size
        Norm of the first function, 1 / denominator, before it was scaled to norm 1.
    """

    columns: RealArray
    recurrence: RealArray
    size: float

    @classmethod
    def over(
        cls, x: RealArray, weight: RealArray, poles: ComplexArray, degree: int
    ) -> NumeratorBasis:
        """Basis up to a degree over given poles, at frequencies ``x`` (F,) with weights (F,)."""
        bare = Rational(np.zeros(0, dtype=complex), poles, 1.0)
        first = real_over_imaginary(weight * bare.response(x))
        size = float(np.linalg.norm(first))
        columns = np.empty((2 * x.size, degree + 1), order="F")
        recurrence = np.zeros((degree + 1, degree))
        columns[:, 0] = first / size
        for k in range(degree):
            real, imaginary = columns[: x.size, k], columns[x.size :, k]
            ahead = np.concatenate([-x * imaginary, x * real])  # times s
            for _ in range(2):  # the second pass removes what rounding left
                share = columns[:, : k + 1].T @ ahead
                ahead -= columns[:, : k + 1] @ share
                recurrence[: k + 1, k] += share
            recurrence[k + 1, k] = np.linalg.norm(ahead)
            columns[:, k + 1] = ahead / recurrence[k + 1, k]
        return cls(columns, recurrence, size)


def numerator_for(program: ResponseFit, poles: ComplexArray, zeros: int) -> Rational:
    """The function of given poles [rad/s] whose numerator of degree ``zeros`` fits best.

    The fit is in the sense of weighted least squares.
    """
    data = program.active
    scale = float(np.sqrt(data.omega[0] * data.omega[-1]))
    basis = NumeratorBasis.over(data.omega / scale, data.weight, poles / scale, zeros)
    shares = basis.columns.T @ real_over_imaginary(data.weight * data.response)
    return with_numerator(basis, shares, poles, scale)


def with_numerator(
    basis: NumeratorBasis, shares: RealArray, poles: ComplexArray, scale: float
) -> Rational:
    """The function whose numerator has given coefficients ``shares`` in a basis, by its roots.

    The basis belongs to frequencies divided by ``scale`` [rad/s].
    """
    degree = shares.size - 1
    negligible = EPS * np.linalg.norm(shares)
    while degree and abs(shares[degree]) <= negligible:
        degree -= 1
    step = basis.recurrence
    companion = step[:degree, :degree].copy()
    if degree:
        companion[:, -1] -= step[degree, degree - 1] * shares[:degree] / shares[degree]
    zeros = conjugate_pairs(np.linalg.eigvals(companion)) if degree else np.zeros(0, dtype=complex)
    leading = shares[degree] / (basis.size * np.prod(np.diag(step, -1)[:degree]))
    # prod(s - p) in s / scale is scale^-n prod(s - scale p)
    return Rational(zeros * scale, poles, leading * scale ** (poles.size - degree))


def real_over_imaginary(values: np.ndarray) -> RealArray:
    """Real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag])
