"""Rational weights of given orders that are at least as large as given squares at each frequency.

A full weight is the spectral factor of R = H~ Q H, where H holds the powers over one denominator:
Q >= 0 is chosen by a semidefinite program so that R(j omega) >= R_f at every frequency, with the
least mean of tr R_f^-1 R, which is the slope of log det R at R_f.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.heavy_types import StateSpace
from workbench.solvers import conic_solvers, solve_conic
from workbench.systems.frequency_response import frequency_response
from workbench.systems.realisation import realisation
from workbench.systems.riccati import hamiltonian_solution
from workbench.uncertainty.covers.weights import CONSTANT_DECADES, beyond, complex_weight
from workbench.uncertainty.matrix_covers.shapes import Shape

MOST_FREQUENCIES = 80
"""Most frequencies of the semidefinite program."""
LEAST_SQUARE = 1e-9
"""Least square of a full weight in any direction, relative to the one asked for there."""


def right_weight(
    omega: RealArray, squares: ComplexArray, shape: Shape, order: int, context: Context
) -> StateSpace:
    """Stable W (n, n) with a stable inverse and W^* W >= squares (F, n, n), in continuous time.

    Parameters
    ----------
    order
        Number of poles of each entry of a diagonal or scalar weight; of a full one n times as many
        are the order.

    Raises
    ------
    SolverError
        No such weight was found.
    """
    import control

    n = squares.shape[-1]
    sizes = np.sqrt(np.einsum("fii->fi", squares).real)
    if shape == "scalar":
        sizes = sizes.max(axis=1, keepdims=True)
    if shape != "full":
        fits = [_magnitude(omega, size, order, context) for size in sizes.T]
        fits = fits * (n if shape == "scalar" else 1)
        return control.append(*[fit.state_space() for fit in fits])
    fit = _magnitude(omega, np.linalg.norm(sizes, axis=1), order, context)
    middles = np.geomspace(omega[0], omega[-1], order - fit.order + 2)[1:-1]
    return _full(omega, squares, np.concatenate([fit.poles, -middles]), context)


def left_weight(
    omega: RealArray, squares: ComplexArray, shape: Shape, order: int, context: Context
) -> StateSpace:
    """As `right_weight`, with W W^* >= squares."""
    W = right_weight(omega, squares.conj(), shape, order, context)
    return realisation((W.A.T, W.C.T, W.B.T, W.D.T), 0.0)


def inverse_weight(W: StateSpace) -> StateSpace:
    """The inverse of a square system with an invertible D."""
    D = np.linalg.inv(W.D)
    return realisation((W.A - W.B @ D @ W.C, W.B @ D, -D @ W.C, D), float(W.dt or 0.0))


def _magnitude(omega: RealArray, size: RealArray, order: int, context: Context) -> Rational:
    """Scalar weight that covers sizes (F,); a constant one where they do not change."""
    if np.ptp(size) <= 1e-9 * size.max():
        return Rational(np.array([]), np.array([]), float(size.max()))
    return complex_weight(omega, size, np.ones_like(size), order, context)


def _full(
    omega: RealArray, squares: ComplexArray, poles: ComplexArray, context: Context
) -> StateSpace:
    """Spectral factor of the least H~ Q H over these poles that is above the squares."""
    import cvxpy as cp

    n = squares.shape[-1]
    unit = float(np.sqrt(omega[0] * omega[-1]))
    chosen = np.unique(
        np.linspace(0, omega.size - 1, min(omega.size, MOST_FREQUENCIES)).astype(int)
    )
    grid = beyond(omega[chosen]) / unit
    ends = CONSTANT_DECADES
    wanted = np.concatenate(
        [
            np.repeat(squares[:1].real, ends, axis=0),
            squares[chosen],
            np.repeat(squares[-1:].real, ends, axis=0),
        ]
    )
    A, b = _states(poles / unit)
    k = len(A)
    psi = np.ones((len(grid), k + 1), complex)
    if k:
        M = np.block([[A, b], [np.eye(k), np.zeros((k, 1))]])
        psi[:, :k] = frequency_response(M, k, 1j * grid)[:, :, 0]
    # a basis that is orthonormal over the grid, in units of what is asked for
    share = psi / np.sqrt(np.einsum("fii->f", wanted).real)[:, None]
    T = np.linalg.inv(np.linalg.qr(np.vstack([share.real, share.imag]))[1]) * np.sqrt(len(grid))
    psi = psi @ T
    roots = np.linalg.inv(np.linalg.cholesky(wanted)).conj().swapaxes(-2, -1)
    H = np.einsum("fk,fij->fkij", psi, roots).reshape(len(grid), -1, n)
    with context.stating():
        Q = cp.Variable((H.shape[1], H.shape[1]), PSD=True)
        inside = slice(ends, len(grid) - ends)
        mean = np.einsum("fki,fli->kl", H[inside], H[inside].conj()).real / len(chosen)
        limits = [h.conj().T @ Q @ h >> np.eye(n) for h in H]
        problem = cp.Problem(cp.Minimize(cp.trace(mean @ Q)), limits)
    solver = next(one for one in conic_solvers() if one.name == "clarabel")
    _, said = solve_conic(problem, solver, context.options, context)
    if Q.value is None:
        raise SolverError(f"the weight over {k} poles has no semidefinite program: {said}")
    S = np.kron(T, np.eye(n))
    square = S @ Q.value @ S.T
    square[-n:, -n:] += LEAST_SQUARE * np.linalg.norm(square[-n:, -n:]) * np.eye(n)
    return _factor(np.kron(A, np.eye(n)) * unit, np.kron(b, np.eye(n)) * unit, square)


def _states(poles: ComplexArray) -> tuple[RealArray, RealArray]:
    """A (k, k) and b (k, 1) whose states are all fractions over these poles."""
    if not poles.size:
        return np.zeros((0, 0)), np.zeros((0, 1))
    system = Rational(np.array([]), poles, 1.0).state_space()
    return system.A, system.B


def _factor(A: RealArray, B: RealArray, square: RealArray) -> StateSpace:
    """Stable W with a stable inverse and W~ W = H~ square H, where H = [(s I - A)^-1 B; I].

    Raises SolverError where the Riccati equation has no solution: a zero lies on the axis.
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
        D = np.linalg.cholesky(R).T
    except LinAlgError:
        raise SolverError("the square of a weight is singular at infinity") from None
    return realisation((A, B, D @ inverse @ (B.T @ X + N.T), D), 0.0)
