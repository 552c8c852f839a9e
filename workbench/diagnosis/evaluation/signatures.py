"""Isolation by a set of residuals: the fault follows from which residuals have fired.

The structure matrix is True where a residual (row) reacts to a fault (column); a column is the
signature of its fault. In a dedicated scheme the matrix is the identity, in a generalised scheme
the complement of the identity (J. Chen and R. J. Patton, Robust Model-Based Fault
Diagnosis for Dynamic Systems, 1999, section 2.5).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import BoolArray
from workbench.errors import InputError

NO_FAULT, AMBIGUOUS = -1, -2
"""Numbers for no fired residual, and for several faults whose signatures are equally near."""


def isolable(structure: ArrayLike) -> bool:
    """Whether every fault of a structure matrix (R, F) has a signature of its own that is not 0.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import isolable
    >>> isolable(np.array([[True, False], [True, True]])), isolable(np.array([[True, True]]))
    (True, False)
    """
    columns = _structure(structure).T
    distinct = len(np.unique(columns, axis=0)) == len(columns)
    return bool(distinct and columns.any(axis=1).all())


def isolate(structure: ArrayLike, fired: ArrayLike) -> NDArray[np.int64]:
    """The number (N,) of the fault whose signature is nearest to the fired residuals (N, R).

    The distance is the number of residuals that differ. The result is NO_FAULT where no residual
    has fired, AMBIGUOUS where two signatures are equally near. Signatures should differ in more
    than one residual, so that a single missed one does not point to another fault. Raises
    InputError if the numbers of residuals differ or entries are not boolean.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import isolate
    >>> structure = np.array([[True, False], [True, True]])  # rows: residuals, columns: faults
    >>> isolate(structure, np.array([[True, True], [False, True], [False, False]])).tolist()
    [0, 1, -1]
    """
    matrix = _structure(structure)
    flags = _flags(fired, "fired")
    if flags.dtype != bool or flags.ndim != 2 or flags.shape[1] != len(matrix):
        raise InputError(
            f"fired has shape {flags.shape} of {flags.dtype}; it must be (N, {len(matrix)}) of bool"
        )
    distance = (flags[:, :, None] != matrix[None]).sum(axis=1)
    nearest = distance.argmin(axis=1)
    ties = (distance == distance.min(axis=1, keepdims=True)).sum(axis=1) > 1
    found = np.where(ties, AMBIGUOUS, nearest)
    return np.where(flags.any(axis=1), found, NO_FAULT).astype(np.int64)


def _structure(structure: ArrayLike) -> BoolArray:
    matrix = _flags(structure, "structure")
    if matrix.dtype != bool or matrix.ndim != 2 or not matrix.size:
        raise InputError(
            f"structure has shape {matrix.shape} of {matrix.dtype}; it must be (R, F) of bool"
        )
    return matrix


def _flags(values: ArrayLike, name: str) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except ValueError:
        raise InputError(f"{name} is {values!r}; its rows must have one length") from None
