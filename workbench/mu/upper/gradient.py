"""The gradient of the upper bound of mixed mu with respect to the matrix.

With t = beta^2 the bound is the least t for which some D and G satisfy

    t D_r - M^H D_l M - j (G M - M^H G^H) >= 0.

Let X >= 0 with tr(X D_r) = 1 be the multiplier of this inequality. X lies in the null space of the
left side, and with it no change of D or G improves the bound to first order. Then

    dt = 2 Re tr X (M^H D_l + j G) dM.

Where X is not unique the bound has a kink, and this formula gives one of its subgradients.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench.errors import InputError
from workbench.input_checks import as_matrices
from workbench.mu.upper.pattern import basis, expanded_multipliers, pattern_of
from workbench.mu.upper.program import UpperBound
from workbench.structure import Structure

NULL_TOLERANCE = 1e-3
"""Eigenvalues within this relative distance of the largest span the null space that X lies in.
Eigenvalues of the path's end differ by its accuracy, 1e-4 or less. With half of it a null direction
may be left out, and the gradient is wrong; with double of it one more enters, with a small weight.
"""
LARGEST = 1e150
"""Largest entry of M whose square still fits a double, with room for sums. Half or double leaves
room for sums of four times as many or a quarter of the terms, 1e8 or so.
"""
TRACE_WEIGHT = 1e3
"""Weight of the normalisation tr(X D_r) = 1 relative to the stationarity conditions. The other rows
are near 1 and cannot all be met; this one must. Half or double changes the trace by 1e-6, and the
gradient is normalised.
"""


def bound_gradient(M: ArrayLike, structure: Structure, bound: UpperBound) -> Array:
    """Gradient of the upper bound with respect to M, with D and G optimal for each M.

    Parameters
    ----------
    M
        Complex or real, shape (..., c, r), finite.
    bound
        The positive upper bound of M by `upper_bound`.

    Returns
    -------
    Gamma of shape (..., r, c): to first order the bound changes by Re tr(Gamma dM).

    Raises
    ------
    InputError
        M does not fit the structure or is not finite; the bound belongs to another batch; or a
        bound is 0, where it has no gradient.

    References
    ----------
    Overton, Womersley, Optimality conditions and duality theory for minimizing sums of the largest
    eigenvalues of symmetric matrices, Mathematical Programming 62 (1993) 321-357.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.mu import bound_gradient, upper_bound
    >>> from workbench.structure import Complex, Real, Structure
    >>> structure = Structure([Real(1), Complex(1)])
    >>> M = np.array([[0.5, 0.2j], [0.3, 0.4]])
    >>> bound_gradient(M, structure, upper_bound(M, structure)).shape
    (2, 2)
    """
    M = as_matrices(M, structure)
    if not isinstance(bound, UpperBound) or bound.G.shape != M.mT.shape:
        raise InputError("bound must be that of this M: `upper_bound(M, structure)`")
    if np.abs(M).max(initial=0.0) > LARGEST:
        raise InputError(f"M has entries above {LARGEST:.3g}, whose squares overflow; scale it")
    if not (bound.value > 0).all():
        raise InputError("the bound is 0 somewhere, and has no gradient there; leave it out")
    return dual(M, structure, bound) @ _half(M, bound) / bound.value[..., None, None]


def dual(M: Array, structure: Structure, bound: UpperBound) -> Array:
    """Multiplier X (..., r, r) of the bound's inequality; see the module's docstring."""
    batch, (c, r) = M.shape[:-2], M.shape[-2:]
    M, D_right = M.reshape(-1, c, r), bound.D_right.reshape(-1, r, r)
    A = M.conj().mT @ bound.D_left.reshape(-1, c, c) @ M
    twisted = 1j * bound.G.reshape(-1, r, c) @ M
    root = np.linalg.inv(np.linalg.cholesky(D_right))
    values, vectors = np.linalg.eigh(root @ (A + twisted + twisted.conj().mT) @ root.conj().mT)
    vectors = root.conj().mT @ vectors
    null = (values > values[:, -1:] - NULL_TOLERANCE * np.abs(values[:, -1:])).sum(axis=1)
    X = np.empty((len(M), r, r), complex)
    for k in np.unique(null):
        some = null == k
        Z = vectors[some][..., r - k :]
        Y = np.eye(1) if k == 1 else _stationary(M[some], structure, values[some, -1], Z)
        X[some] = Z @ Y @ Z.conj().mT
    return X.reshape(*batch, r, r)


def _stationary(M: Array, structure: Structure, t: Array, Z: Array) -> Array:
    """Y >= 0 (F, k, k) of trace 1 such that Z Y Z^H is orthogonal to every change of D and G."""
    k = Z.shape[-1]
    left, right, twist = _basis(structure)
    twisted = 1j * twist @ M[:, None]
    change = M[:, None].conj().mT @ left @ M[:, None] + twisted + twisted.conj().mT
    change = change - t[:, None, None, None] * right
    change = Z[:, None].conj().mT @ change @ Z[:, None]
    hermitian = _hermitian(k)
    rows = np.einsum("eij,fbji->fbe", hermitian, change).real
    rows /= np.abs(rows).max(axis=(1, 2), keepdims=True) + np.finfo(float).tiny
    trace = TRACE_WEIGHT * np.trace(hermitian, axis1=1, axis2=2).real
    system = np.concatenate([rows, np.broadcast_to(trace, (len(M), 1, k * k))], axis=1)
    Y = np.tensordot(TRACE_WEIGHT * np.linalg.pinv(system)[..., -1], hermitian, axes=1)
    values, vectors = np.linalg.eigh(Y)
    values = np.maximum(values, 0.0)
    Y = (vectors * values[:, None, :]) @ vectors.conj().mT
    return np.asarray(Y / values.sum(axis=1)[:, None, None])


def _half(M: Array, bound: UpperBound) -> Array:
    """M^H D_l + j G."""
    return M.conj().mT @ bound.D_left + 1j * bound.G


@lru_cache(maxsize=32)
def _basis(structure: Structure) -> tuple[Array, Array, Array]:
    """D_l, D_r and G (unknowns, ...), each with one unknown at 1 and the others at 0."""
    pattern = pattern_of(structure)
    parts = zip(*(expanded_multipliers(pattern, D, G) for D, G in basis(pattern)), strict=True)
    left, right, twist = (np.array(part) for part in parts)
    return left, right, twist


@lru_cache(maxsize=32)
def _hermitian(k: int) -> Array:
    """A basis (k^2, k, k) of the Hermitian matrices."""
    unit = np.eye(k * k).reshape(k, k, k, k)
    real = [unit[i, j] + unit[j, i] for i in range(k) for j in range(i, k)]
    imaginary = [1j * (unit[i, j] - unit[j, i]) for i in range(k) for j in range(i + 1, k)]
    return np.array(real + imaginary)
