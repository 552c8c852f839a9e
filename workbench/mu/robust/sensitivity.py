"""Which blocks a bound of mu rests on: its relative change with the size of each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.input_checks import as_matrices
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Structure

STEP = 1e-3
"""Change of log size on either side; the bound is smooth to about 1e-8 and its curvature near 1."""


def sensitivity(M: Any, structure: Structure) -> NDArray[np.float64]:
    """d log(upper bound) / d log(size of a block), for each block and matrix of a batch.

    A block of size s acts as one of size 1 with its columns of M multiplied by s. The upper bound
    is homogeneous, so that the numbers of a matrix add up to 1, and none is negative.

    Parameters
    ----------
    M
        Complex or real (..., columns, rows), finite; what Delta closes.
    structure
        Blocks of Delta.

    Returns
    -------
    (..., blocks), 0 where the bound is 0. By central differences over 1e-3 of the logarithm,
    accurate to about 1e-5; where the bound has a kink it is the mean of its two slopes.

    Raises
    ------
    InputError
        M that does not fit the structure or is not finite.
    """
    M = as_matrices(M, structure)
    factors = np.ones((2, len(structure), structure.rows))
    for k, row in enumerate(structure.row_slices):
        factors[:, k, row] = np.exp([[STEP], [-STEP]])
    value = upper_bound(M[..., None, None, :, :] * factors[..., None, :], structure).value
    larger, smaller = value[..., 0, :], value[..., 1, :]
    positive = (larger > 0) & (smaller > 0)
    ratio = np.where(positive, larger, 1.0) / np.where(positive, smaller, 1.0)
    change: NDArray[np.float64] = np.log(ratio) / (2 * STEP)
    return change
