"""Arithmetic of linear fractional transformations (LFT): matrices rational in uncertain scalars.

    value(delta) = M22 + M21 Delta (I - M11 Delta)^-1 M12,    Delta = diag(delta of each channel)

Sums, products and inverses of LFTs are LFTs (Redheffer; Zhou, Doyle and Glover, Robust and Optimal
Control, 1996, chapter 10). A state-space system is an LFT in delta = 1/s.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from workbench._core.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.systems.balancing import singular

INTEGRATOR = "1/s"
"""Name of the scalar whose channels are the states of a system."""

SINGULAR_DETERMINANT = 1e-13
"""A model counts as singular if det(I - M11 Delta) is below this; at the nominal it is 1."""


@dataclass(frozen=True, eq=False)
class LFT:
    """A matrix (m, n) that is a rational function of named scalars.

    ``M`` is [M11 M12; M21 M22] with shape (r + m, r + n); ``names`` holds the scalar's name for
    each of the r channels. `+ - * / **` and `@` have the same meaning as for arrays, but one
    operand of `*` must be a scalar (1, 1).
    """

    M: Array
    names: tuple[str, ...] = ()

    # NumPy arrays then use this class's operators.
    __array_ufunc__: ClassVar[None] = None

    @property
    def shape(self) -> tuple[int, int]:
        """Shape (m, n) of the value."""
        r = len(self.names)
        return self.M.shape[0] - r, self.M.shape[1] - r

    @property
    def blocks(self) -> tuple[Array, Array, Array, Array]:
        """The blocks M11, M12, M21 and M22 of M."""
        r = len(self.names)
        return self.M[:r, :r], self.M[:r, r:], self.M[r:, :r], self.M[r:, r:]

    def repetitions(self) -> dict[str, int]:
        """Number of channels of each scalar, by name, in the order of first appearance."""
        return {name: self.names.count(name) for name in dict.fromkeys(self.names)}

    def __call__(self, values: Mapping[str, ArrayLike]) -> Array:
        """Value (..., m, n) at given scalars (...), by name.

        Raises InputError if I - M11 Delta is singular; the message says for which values.
        """
        M11, M12, M21, M22 = self.blocks
        if not self.names:
            return M22
        delta = np.stack(np.broadcast_arrays(*(np.asarray(values[n]) for n in self.names)), -1)
        loop = np.eye(len(self.names)) - delta[..., None] * M11
        flat = abs(np.linalg.det(loop)) < SINGULAR_DETERMINANT
        if flat.any():
            first = delta[flat][0]
            at = {n: float(first[i].real) for i, n in enumerate(self.names)}
            raise InputError(
                "the model is not well posed: it divides by zero, or inverts a singular matrix, at "
                + ", ".join(f"delta of {name} = {value:g}" for name, value in at.items())
                + "; narrow the tolerances or rewrite the model"
            )
        return M22 + M21 @ np.linalg.solve(loop, delta[..., None] * M12)

    def __add__(self, other: object) -> LFT:
        a, b = self, lift(other)
        a, b = _spread(a, b.shape), _spread(b, a.shape)
        if a.shape != b.shape:
            raise InputError(f"a sum of matrices with shapes {a.shape} and {b.shape}")
        if _is_zero(a) or _is_zero(b):
            return b if _is_zero(a) else a
        rows, columns = np.eye(a.shape[0]), np.eye(a.shape[1])
        return np.hstack([rows, rows]) @ diagonal(a, b) @ np.vstack([columns, columns])

    def __radd__(self, other: object) -> LFT:
        return self + other

    def __neg__(self) -> LFT:
        return -np.eye(self.shape[0]) @ self

    def __sub__(self, other: object) -> LFT:
        return self + -lift(other)

    def __rsub__(self, other: object) -> LFT:
        return -self + other

    def __matmul__(self, other: object) -> LFT:
        a, b = self, lift(other)
        if a.shape[1] != b.shape[0]:
            raise InputError(f"a product of matrices with shapes {a.shape} and {b.shape}")
        if _is_zero(a) or _is_zero(b):
            return LFT(np.zeros((a.shape[0], b.shape[1])))
        (a11, a12, a21, a22), (b11, b12, b21, b22) = a.blocks, b.blocks
        below = np.zeros((len(b11), len(a11)))
        M = np.block([[a11, a12 @ b21, a12 @ b22], [below, b11, b12], [a21, a22 @ b21, a22 @ b22]])
        return LFT(M, a.names + b.names)

    def __rmatmul__(self, other: object) -> LFT:
        return lift(other) @ self

    def __mul__(self, other: object) -> LFT:
        a, b = self, lift(other)
        if a.shape == (1, 1):
            a, b = b, a
        if b.shape != (1, 1):
            raise InputError(
                f"`*` of matrices with shapes {a.shape} and {b.shape}; use @ for their product"
            )
        # Repeat the scalar along the shorter side of the matrix: fewer channels.
        m, n = a.shape
        return diagonal(*[b] * m) @ a if m < n else a @ diagonal(*[b] * n)

    def __rmul__(self, other: object) -> LFT:
        return self * other

    def __truediv__(self, other: object) -> LFT:
        return self * _reciprocal(lift(other))

    def __rtruediv__(self, other: object) -> LFT:
        return lift(other) * _reciprocal(self)

    def __pow__(self, exponent: object) -> LFT:
        if not isinstance(exponent, int | np.integer) or self.shape != (1, 1):
            raise InputError(
                f"power {exponent!r} of a matrix with shape {self.shape}; only integer powers of "
                "scalars are rational"
            )
        base = self if exponent >= 0 else _reciprocal(self)
        return reduce(LFT.__matmul__, [base] * abs(int(exponent)), LFT(np.ones((1, 1))))


def scalar(name: str, nominal: float, deviation: float) -> LFT:
    """The LFT nominal + deviation * delta, where delta is the scalar with this name."""
    return LFT(np.array([[0.0, 1.0], [deviation, nominal]]), (name,))


def lift(value: Any) -> LFT:
    """The LFT of a number, of a matrix of numbers or LFTs (nested lists, object arrays), or an LFT.

    Raises InputError for a vector, because it could be a row or a column.
    """
    if isinstance(value, LFT):
        return value
    array = np.asarray(value)
    if array.ndim == 1 or array.ndim > 2:
        raise InputError(
            f"an array of shape {array.shape} where a number or a matrix is needed; write a "
            "column as [[a], [b]], a row as [[a, b]]"
        )
    if array.dtype == object and not array.ndim and array[()] is value:
        raise InputError(
            f"{type(value).__name__} is no number, matrix or uncertain value; use `block` to put "
            "systems together"
        )
    array = np.atleast_2d(array)
    if array.dtype != object:
        if array.dtype.kind not in "biuf":
            raise InputError(f"{value!r} in a model; its constants must be real numbers")
        return LFT(array.astype(float))
    return _stack([[lift(entry) for entry in row] for row in array])


def block_matrix(rows: Sequence[Sequence[Any]]) -> Any:
    """Matrix from rows of blocks, each a number, a matrix or an LFT.

    The result is an LFT if one of the blocks is an LFT, and otherwise an array of floats. Raises
    InputError if the shapes of the blocks do not fit together.

    Examples
    --------
    >>> from workbench.uncertainty import block_matrix
    >>> block_matrix([[1.0, 2.0], [3.0, 4.0]]).tolist()
    [[1.0, 2.0], [3.0, 4.0]]
    """
    blocks = [[lift(entry) for entry in row] for row in rows]
    result = _stack(blocks)
    return result if result.names or _any_lft(entry for row in rows for entry in row) else result.M


def left_divide(a: Any, b: Any) -> Any:
    """a^-1 b for matrices of numbers or LFTs; an LFT if one of them contains an LFT.

    Raises InputError if `a` is not square, or is singular at the nominal values.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import left_divide
    >>> left_divide(np.array([[2.0, 0.0], [0.0, 4.0]]), np.array([[1.0], [1.0]])).ravel().tolist()
    [0.5, 0.25]
    """
    if _any_lft((a, b)):
        return inverse(a) @ lift(b)
    return inverse(a) @ np.asarray(b, dtype=float)


def inverse(a: Any) -> Any:
    """a^-1 of a square matrix of numbers or LFTs; raises InputError like `left_divide`.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, inverse, block_matrix, parametric_lft
    >>> def model(m):
    ...     '''x'' = f / m, its mass block_matrix inverted.'''
    ...     return (
    ...         [[0.0, 1.0], [0.0, 0.0]],
    ...         block_matrix([[0.0], [inverse(block_matrix([[m]]))]]),
    ...         [[1.0, 0.0]],
    ...         [[0.0]],
    ...     )
    ...
    >>> found = parametric_lft(model, [Parameter("m", 2.0, 0.1)], inputs=["f"], outputs=["x"])
    >>> found.at([0.0]).B.ravel().tolist()
    [0.0, 0.5]
    """
    value = lift(a)
    a11, a12, a21, a22 = value.blocks
    if a22.shape[0] != a22.shape[1]:
        raise InputError(f"inverse of a matrix with shape {a22.shape}; it must be square")
    if singular(a22):
        raise InputError(
            "division by a value, or inverse of a matrix, that is zero or singular at the nominal "
            f"parameters: {a22.tolist()}; rewrite the model or move the nominal"
        )
    inv = np.linalg.inv(a22)
    if not _any_lft((a,)):
        return inv
    M = np.block([[a11 - a12 @ inv @ a21, a12 @ inv], [-inv @ a21, inv]])
    return LFT(M, value.names)


def diagonal(*values: LFT) -> LFT:
    """Block-diagonal matrix of LFTs."""
    parts = zip(*(value.blocks for value in values), strict=True)
    m11, m12, m21, m22 = (block_diag(*part) for part in parts)
    return LFT(np.block([[m11, m12], [m21, m22]]), sum((v.names for v in values), ()))


def _reciprocal(value: LFT) -> LFT:
    """1 / value of a scalar; raises InputError for a matrix."""
    if value.shape != (1, 1):
        raise InputError(
            f"division by a matrix with shape {value.shape}; use left_divide or inverse"
        )
    reciprocal: LFT = inverse(value)
    return reciprocal


def _spread(value: LFT, shape: tuple[int, int]) -> LFT:
    """A scalar becomes a matrix of equal entries; matrices are returned unchanged."""
    if value.shape != (1, 1) or shape == (1, 1):
        return value
    return np.ones((shape[0], 1)) @ value @ np.ones((1, shape[1]))


def _stack(rows: Sequence[Sequence[LFT]]) -> LFT:
    """Matrix from rows of blocks."""
    return _join([_join(row, axis=1) for row in rows], axis=0)


def _join(parts: Sequence[LFT], axis: int) -> LFT:
    """Matrix of the parts, side by side (axis 1) or one below the other (axis 0)."""
    common = {part.shape[1 - axis] for part in parts}
    if len(common) != 1:
        shapes = ", ".join(str(part.shape) for part in parts)
        place = "beside" if axis else "below"
        raise InputError(f"matrices with shapes {shapes} do not fit {place} each other")
    ones = [np.eye(common.pop())] * len(parts)
    stacked = diagonal(*parts)
    return np.hstack(ones) @ stacked if axis else stacked @ np.vstack(ones)


def _is_zero(value: LFT) -> bool:
    """Whether an LFT is the constant 0."""
    return not value.names and not value.M.any()


def _any_lft(values: Iterable[Any]) -> bool:
    """Whether one of the values is an LFT or contains one."""
    return any(np.asarray(value).dtype == object for value in values)


def linked(whole: LFT, links: RealArray, enters: RealArray, leaves: RealArray) -> LFT:
    """The LFT from w to leaves y, where outputs y return to inputs v = links y + enters w.

    I - links M22 must be regular. Channels are not duplicated.
    """
    m11, m12, m21, m22 = whole.blocks
    loop = np.eye(len(links)) - links @ m22
    back = np.linalg.solve(loop, np.hstack([links @ m21, enters]))
    r = len(whole.names)
    top = m12 @ back
    top[:, :r] += m11
    low = m22 @ back
    low[:, :r] += m21
    return LFT(np.vstack([top, leaves @ low]), whole.names)


def lft_series(a: LFT, b: LFT) -> LFT:
    """The product in series; a factor with one input and one output multiplies each entry."""
    scalar = (1, 1) in (a.shape, b.shape) and a.shape[1] != b.shape[0]
    return a * b if scalar else a @ b


def lft_quotient(a: LFT, b: LFT) -> LFT:
    """The quotient a / b. The reciprocal of a scalar comes first, so that all rows of a matrix
    share it.
    """
    return inverse(b) @ a if a.shape == b.shape == (1, 1) else lft_series(a, inverse(b))
