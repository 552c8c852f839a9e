"""Numerators of a limited degree over given poles, in a basis orthonormal over the data.

Hokanson, SIAM J. Sci. Comput. 42(2), 2020, after Brubeck, Nakatsukasa and Trefethen, SIAM Review
63(2), 2021: Arnoldi's polynomials stay well conditioned where powers of s do not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational, paired
from workbench.fitting.response.program import ResponseFit

EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class NumeratorBasis:
    """Real polynomials in s over a denominator, orthonormal over weighted data: Arnoldi's.

    ``columns`` (2 F, m + 1) are the real, then the imaginary parts of their weighted values;
    ``recurrence`` (m + 1, m) multiplies by s; ``size`` is the norm of the first, a constant,
    before it was made 1.
    """

    columns: RealArray
    recurrence: RealArray
    size: float

    @classmethod
    def over(
        cls, x: RealArray, weight: RealArray, poles: ComplexArray, degree: int
    ) -> NumeratorBasis:
        bare = Rational(np.zeros(0, dtype=complex), poles, 1.0)
        first = stacked(weight * bare.response(x))
        size = float(np.linalg.norm(first))
        columns = np.empty((2 * x.size, degree + 1), order="F")
        recurrence = np.zeros((degree + 1, degree))
        columns[:, 0] = first / size
        for k in range(degree):
            real, imaginary = columns[: x.size, k], columns[x.size :, k]
            ahead = np.concatenate([-x * imaginary, x * real])  # times s
            for _ in range(2):  # once more, against rounding
                share = columns[:, : k + 1].T @ ahead
                ahead -= columns[:, : k + 1] @ share
                recurrence[: k + 1, k] += share
            recurrence[k + 1, k] = np.linalg.norm(ahead)
            columns[:, k + 1] = ahead / recurrence[k + 1, k]
        return cls(columns, recurrence, size)


def numerator_for(program: ResponseFit, poles: ComplexArray, zeros: int) -> Rational:
    """The function of given poles [rad/s] whose numerator, of a given degree, fits best."""
    data = program.active
    scale = float(np.sqrt(data.omega[0] * data.omega[-1]))
    basis = NumeratorBasis.over(data.omega / scale, data.weight, poles / scale, zeros)
    shares = basis.columns.T @ stacked(data.weight * data.response)
    return with_numerator(basis, shares, poles, scale)


def with_numerator(
    basis: NumeratorBasis, shares: RealArray, poles: ComplexArray, scale: float
) -> Rational:
    """The function whose numerator has given shares of a basis, by its roots."""
    degree = shares.size - 1
    negligible = EPS * np.linalg.norm(shares)
    while degree and abs(shares[degree]) <= negligible:
        degree -= 1
    step = basis.recurrence
    companion = step[:degree, :degree].copy()
    if degree:
        companion[:, -1] -= step[degree, degree - 1] * shares[:degree] / shares[degree]
    zeros = paired(np.linalg.eigvals(companion)) if degree else np.zeros(0, dtype=complex)
    leading = shares[degree] / (basis.size * np.prod(np.diag(step, -1)[:degree]))
    # prod(s - p) in s / scale is scale^-n prod(s - scale p)
    return Rational(zeros * scale, poles, leading * scale ** (poles.size - degree))


def stacked(values: np.ndarray) -> RealArray:
    """Real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag])
