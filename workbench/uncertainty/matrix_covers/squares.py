"""Rational squares W~ W over given poles, linear in the unknowns of a semidefinite program.

For the poles of one denominator, W~ W = H~ Q H with Q >= 0, where H consists of the partial
fractions and 1. The weight W, stable with a stable inverse, is the spectral factor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import LinAlgError

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certify.cones.form import triangle
from workbench.errors import SolverError
from workbench.fitting.rational import Rational
from workbench.systems.equations.riccati import hamiltonian_solution
from workbench.systems.frequency_response import frequency_response
from workbench.systems.realisation import realisation
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose

LEAST_SQUARE = 1e-4
"""Least value of W~ W, relative to its mean. Without it W could have a zero on the axis. A size of
1 % of its mean hides no plant. With half of it weights may fall to 0.7 %; with double of it they
stay above 1.4 %.
"""


class RationalSquare:
    """W~ W = H~ (Q + least) H of size n, with the upper triangle of Q >= 0 as unknowns.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s].
    square
        Approximate values (F,) of the square; the basis is orthonormal in these units.
    poles
        Poles [rad/s] of every entry.
    """

    def __init__(self, omega: RealArray, square: RealArray, poles: Array, n: int) -> None:
        self.n, self.unit = n, float(np.sqrt(omega[0] * omega[-1]))
        self.A, self.b = _states(poles / self.unit)
        k = len(self.A)
        functions = np.ones((omega.size, k + 1), complex)
        if k:
            M = np.block([[self.A, self.b], [np.eye(k), np.zeros((k, 1))]])
            functions[:, :k] = frequency_response(M, k, 1j * omega / self.unit)[:, :, 0]
        share = functions / np.sqrt(square)[:, None]
        corner = np.linalg.qr(np.vstack([share.real, share.imag]))[1]
        self.turn = np.linalg.inv(corner) * np.sqrt(omega.size)
        basis = functions @ self.turn
        self.H = np.einsum("fk,ij->fkij", basis, np.eye(n)).reshape(omega.size, -1, n)
        self.order = self.H.shape[1]
        self.places = np.array(triangle(self.order))

    def __len__(self) -> int:
        """Number of unknowns."""
        return len(self.places)

    def at(self, numbers: np.ndarray, roots: Array) -> tuple[Array, Array]:
        """The matrix root^* W~ W root at the frequencies with these indices (f,), for roots (f, n,
        m).

        Returns the coefficients (f, unknowns, m, m) of the unknowns, and the constant part (f, m,
        m).
        """
        h = self.H[numbers] @ roots
        a, b = self.places.T
        first = h[:, a].conj()[..., :, None] * h[:, b][..., None, :]
        second = h[:, b].conj()[..., :, None] * h[:, a][..., None, :]
        found = np.where((a == b)[:, None, None], first, first + second)
        return found, LEAST_SQUARE * np.einsum("fki,fkj->fij", h.conj(), h)

    def matrix(self, unknowns: RealArray) -> RealArray:
        """The matrix Q."""
        found = np.zeros((self.order, self.order))
        a, b = self.places.T
        found[a, b] = found[b, a] = unknowns
        return found

    def weight(self, unknowns: RealArray) -> StateSpace:
        """The spectral factor W; raises SolverError if there is none."""
        S, unit = np.kron(self.turn, np.eye(self.n)), np.eye(self.n)
        Q = self.matrix(unknowns) + LEAST_SQUARE * np.eye(self.order)
        return _factor(
            np.kron(self.A, unit) * self.unit, np.kron(self.b, unit) * self.unit, S @ Q @ S.T
        )


class ShapedSquare:
    """W~ W of a shape: one `RationalSquare` for all channels, or one for each.

    Parameters
    ----------
    sizes
        Sizes (F, n) of the channels of W.
    poles
        For a diagonal weight the poles of each channel, otherwise one set for all.
    """

    def __init__(
        self, omega: RealArray, sizes: RealArray, shape: WeightShape, poles: Sequence[Array]
    ) -> None:
        self.shape, self.n = shape, sizes.shape[1]
        self.unit = np.exp(np.log(sizes).mean(axis=0))
        if shape == "scalar":
            self.unit = np.full(self.n, self.unit.max())
        about = (sizes / self.unit) ** 2
        if shape == "diagonal":
            pairs = zip(about.T, poles, strict=True)
            self.parts = [RationalSquare(omega, square, its, 1) for square, its in pairs]
        else:
            size = self.n if shape == "full" else 1
            self.parts = [RationalSquare(omega, about.mean(axis=1), poles[0], size)]

    def __len__(self) -> int:
        """Number of unknowns."""
        return sum(len(part) for part in self.parts)

    def at(self, numbers: np.ndarray, roots: Array) -> tuple[Array, Array]:
        """The same as `RationalSquare.at`, for this weight."""
        roots = self.unit[:, None] * roots
        if self.shape == "full":
            return self.parts[0].at(numbers, roots)
        # the square of a row of a diagonal W, times the factors on both sides
        rows = roots if self.shape == "diagonal" else roots[:, None]
        one = np.ones((len(numbers), 1, 1), complex)
        found, constant = [], 0.0
        for i, part in enumerate(self.parts):
            row = rows[:, i]
            gram = (
                np.einsum("fi,fj->fij", row.conj(), row)
                if self.shape == "diagonal"
                else ctranspose(row) @ row
            )
            each, least = part.at(numbers, one)
            found.append(each * gram[:, None])
            constant = constant + least * gram
        return np.concatenate(found, axis=1), np.asarray(constant)

    def slope(self, weights: RealArray, roots: Array) -> RealArray:
        """Derivative of sum_f weights_f tr root_f^* W~ W root_f by the unknowns."""
        coefficients, _ = self.at(np.arange(len(weights)), roots)
        slope: RealArray = np.einsum("f,fkii->k", weights, coefficients).real
        return slope

    def split(self, unknowns: RealArray) -> list[tuple[RationalSquare, RealArray]]:
        """The parts with their unknowns."""
        ends = np.cumsum([len(part) for part in self.parts])
        return list(zip(self.parts, np.split(unknowns, ends[:-1]), strict=True))

    def weight(self, unknowns: RealArray) -> StateSpace:
        """The weight W; raises SolverError if a part has no spectral factor."""
        import control

        found = [part.weight(its) for part, its in self.split(unknowns)]
        W = control.append(*(found * self.n if self.shape == "scalar" else found))
        return realisation((W.A, W.B * self.unit, W.C, W.D * self.unit), 0.0)


def _states(poles: Array) -> tuple[RealArray, RealArray]:
    """A (k, k) and b (k, 1) whose states span all partial fractions of these poles."""
    if not poles.size:
        return np.zeros((0, 0)), np.zeros((0, 1))
    system = Rational(np.array([]), poles, 1.0).state_space()
    return system.A, system.B


def _factor(A: Array, B: Array, square: Array) -> StateSpace:
    """Stable W with a stable inverse and W~ W = H~ square H, where H = [(s I - A)^-1 B; I].

    Raises SolverError if the Riccati equation has no solution, because a zero lies on the axis.
    """
    n = len(A)
    Q, N, R = square[:n, :n], square[:n, n:], square[n:, n:]
    inverse = np.linalg.inv(R)
    closed = A - B @ inverse @ N.T
    X = hamiltonian_solution(
        np.block([[closed, -B @ inverse @ B.T], [-(Q - N @ inverse @ N.T), -closed.T]])
    )
    if X is None:
        raise SolverError("the square of a weight has a zero on the imaginary axis")
    try:
        D: Array = np.linalg.cholesky(R).T
    except LinAlgError:
        raise SolverError("the square of a weight is singular at infinity") from None
    return realisation((A, B, D @ inverse @ (B.T @ X + N.T), D), 0.0)
