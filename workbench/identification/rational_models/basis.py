"""Real polynomials over a fixed denominator, orthonormal over the data, as coordinates of fits.

Numerators N / D0 and changes of the denominator D / D0 are written in one basis q_k / D0, where q_k
has degree k. Arnoldi's iteration makes it orthonormal over the data. So its coefficients stay well
conditioned over many decades, while coefficients of powers of s lose all digits (P. D. Brubeck, Y.
Nakatsukasa and L. N. Trefethen, SIAM Review 63(2), 2021). The variable x is s in units of a
frequency, or z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench.fitting.rational import conjugate_pairs


@dataclass(frozen=True, eq=False)
class DenominatorBasis:
    """The functions q_k / D0, k = 0 ... n, at F points of the data.

    Parameters
    ----------
    poles
        Roots (n,) of D0, in conjugate pairs.
    values
        Values (F, n + 1) at the points.
    recurrence
        Matrix (n + 1, n) of the multiplication by x: x q_k = sum_j q_j recurrence[j, k].
    first
        The constant function q_0.
    one
        Coefficients (n + 1,) of D0 itself: sum_k one_k q_k = D0.
    """

    poles: ComplexArray
    values: ComplexArray
    recurrence: RealArray
    first: float
    one: RealArray

    @classmethod
    def over(cls, x: ComplexArray, weight: RealArray, poles: ComplexArray) -> DenominatorBasis:
        """The basis over points x (F,) with weights (F,) and a denominator with these poles."""
        n = poles.size
        bare = weight.astype(complex)
        for pole in poles:
            bare = bare / (x - pole)
        size = float(np.linalg.norm(bare))
        columns = np.empty((x.size, n + 1), complex)
        recurrence = np.zeros((n + 1, n))
        columns[:, 0] = bare / size
        for k in range(n):
            ahead = x * columns[:, k]
            for _ in range(2):  # the second pass removes the rounding of the first
                share = (columns[:, : k + 1].conj().T @ ahead).real
                ahead = ahead - columns[:, : k + 1] @ share
                recurrence[: k + 1, k] += share
            recurrence[k + 1, k] = np.linalg.norm(ahead)
            columns[:, k + 1] = ahead / recurrence[k + 1, k]
        one = (columns.conj().T @ weight).real
        values = np.asarray(columns / weight[:, None], complex)
        return cls(poles, values, recurrence, 1.0 / size, one)

    def polynomials(self, x: ComplexArray) -> ComplexArray:
        """Values (X, n + 1) of the q_k alone at any points (X,)."""
        n = self.poles.size
        found = np.empty((x.size, n + 1), complex)
        found[:, 0] = self.first
        for k in range(n):
            ahead = x * found[:, k] - found[:, : k + 1] @ self.recurrence[: k + 1, k]
            found[:, k + 1] = ahead / self.recurrence[k + 1, k]
        return found

    def at(self, x: ComplexArray) -> ComplexArray:
        """Values (X, n + 1) of the q_k / D0 at any points (X,)."""
        found = self.polynomials(x)
        for pole in self.poles:
            found = found / (x - pole)[:, None]
        return found

    def roots(self, coefficients: RealArray) -> tuple[ComplexArray, float]:
        """Roots and leading coefficient of the polynomial sum_k coefficients_k q_k."""
        degree = coefficients.size - 1
        negligible = EPS * np.linalg.norm(coefficients)
        while degree and abs(coefficients[degree]) <= negligible:
            degree -= 1
        companion = self.recurrence[:degree, :degree].copy()
        if degree:
            step = self.recurrence[degree, degree - 1]
            companion[:, -1] -= step * coefficients[:degree] / coefficients[degree]
        found = conjugate_pairs(np.linalg.eigvals(companion)) if degree else np.zeros(0, complex)
        scale = np.prod(np.diag(self.recurrence, -1)[:degree])
        return found, float(coefficients[degree] * self.first / scale)

    def moved(self, change: RealArray) -> ComplexArray:
        """Poles (n,) of the monic denominator D0 + sum_k change_k q_k, k < n."""
        coefficients = self.one.copy()
        coefficients[: change.size] += change
        return self.roots(coefficients)[0]

    def pole_slopes(self) -> ComplexArray:
        """Derivatives (n, n) of the poles with respect to the changes of the denominator.

        Poles that coincide have none: their rows are not finite.
        """
        apart = self.poles[:, None] - self.poles
        np.fill_diagonal(apart, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = -self.polynomials(self.poles)[:, :-1] / np.prod(apart, axis=1)[:, None]
        return slopes
