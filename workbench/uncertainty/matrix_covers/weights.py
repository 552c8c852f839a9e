"""Rational weights W of given orders with W~ W at least as large as given squares.

A full weight is the spectral factor of R = H~ Q H, where H consists of the partial fractions of one
denominator and 1. A semidefinite program chooses Q >= 0 with R(j omega) >= R_f at every frequency
and the least mean of tr R_f^-1 R, which is the linearisation of log det R at R_f.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.systems.realisation import realisation, transposed_system
from workbench.uncertainty.covers.weights import CONSTANT_DECADES, beyond, complex_weight
from workbench.uncertainty.matrix_covers.semidefinite import least
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose
from workbench.uncertainty.matrix_covers.squares import ShapedSquare

MOST_FREQUENCIES = 80
"""Largest number of frequencies of the semidefinite program. Its time grows with their number times
the square of the unknowns. With half of them peaks between frequencies are covered by the gain;
double takes twice as long.
"""


@dataclass(frozen=True)
class FittedWeight:
    """A weight in continuous time, with the poles of each channel if it is diagonal, or of all
    channels.

    ``fits`` are the channels of a diagonal weight, or the one function of a scalar weight.
    """

    system: StateSpace
    poles: list[Array]
    fits: list[Rational]


def right_weight(
    omega: RealArray, squares: Array, shape: WeightShape, order: int, context: Context
) -> FittedWeight:
    """Stable W (n, n) with a stable inverse and W^* W >= squares (F, n, n), in continuous time.

    Parameters
    ----------
    order
        Number of poles of each channel of a diagonal or scalar weight. A full weight has n times as
        many states.

    Raises
    ------
    SolverError
        No such weight was found.
    """
    n = squares.shape[-1]
    sizes = np.sqrt(np.einsum("fii->fi", squares).real)
    if shape == "scalar":
        sizes = sizes.max(axis=1, keepdims=True)
    if shape != "full":
        fits = [_magnitude(omega, size, order, context) for size in sizes.T]
        return diagonal_weight(fits, n)
    fit = _magnitude(omega, np.linalg.norm(sizes, axis=1), order, context)
    middles = np.geomspace(omega[0], omega[-1], order - fit.order + 2)[1:-1]
    poles = np.concatenate([fit.poles, -middles])
    return FittedWeight(_full(omega, squares, poles, context), [poles], [])


def diagonal_weight(fits: list[Rational], n: int) -> FittedWeight:
    """The diagonal weight of n channels with these functions; a single function is used in each
    channel.
    """
    import control

    systems = [fit.state_space() for fit in fits] * (n if len(fits) == 1 else 1)
    return FittedWeight(control.append(*systems), [fit.poles for fit in fits], fits)


def left_weight(
    omega: RealArray, squares: Array, shape: WeightShape, order: int, context: Context
) -> FittedWeight:
    """As `right_weight`, but with W W^* >= squares."""
    found = right_weight(omega, squares.conj(), shape, order, context)
    return FittedWeight(transposed_system(found.system), found.poles, found.fits)


def inverse_weight(W: StateSpace) -> StateSpace:
    """The inverse of a square system with an invertible D."""
    D = np.linalg.inv(W.D)
    return realisation((W.A - W.B @ D @ W.C, W.B @ D, -D @ W.C, D), float(W.dt or 0.0))


def _magnitude(omega: RealArray, size: RealArray, order: int, context: Context) -> Rational:
    """Scalar weight that covers sizes (F,); a constant if the sizes do not change."""
    if np.ptp(size) <= 1e-9 * size.max():
        return Rational(np.array([]), np.array([]), float(size.max()))
    return complex_weight(omega, size, np.ones_like(size), order, context)


def _full(omega: RealArray, squares: Array, poles: Array, context: Context) -> StateSpace:
    """Spectral factor of the least H~ Q H with these poles that is above the squares."""
    n = squares.shape[-1]
    chosen = thinned(omega.size)
    grid, wanted = beyond(omega[chosen]), lasting_squares(squares[chosen])
    roots = ctranspose(np.linalg.inv(np.linalg.cholesky(wanted)))
    sizes = np.sqrt(np.einsum("fii->fi", wanted).real)
    square = ShapedSquare(grid, sizes, "full", [poles])
    coefficients, constant = square.at(np.arange(len(grid)), roots)
    inside = np.zeros(len(grid))
    inside[CONSTANT_DECADES:-CONSTANT_DECADES] = 1 / len(chosen)
    limits = [(coefficients, constant - np.eye(n))]
    return square.weight(least(square.slope(inside, roots), [square], limits, context))


def thinned(count: int) -> np.ndarray:
    """Indices of at most MOST_FREQUENCIES of `count` frequencies."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_FREQUENCIES)).astype(int))


def lasting_squares(squares: Array) -> Array:
    """Squares (F, n, n) continued as real constants at the frequencies of `beyond`."""
    ends = [np.repeat(part.real, CONSTANT_DECADES, axis=0) for part in (squares[:1], squares[-1:])]
    return np.concatenate([ends[0], squares, ends[1]])
