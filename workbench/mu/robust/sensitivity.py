"""Sensitivity of an upper bound of mu to the size of each block."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.input_checks import as_matrices
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Structure

LOG_SIZE_STEP = 1e-3
"""Step of the central difference in the logarithm of a block's size. The bound is smooth to about
1e-8 and its curvature is near 1."""


def sensitivity(M: Any, structure: Structure) -> NDArray[np.float64]:
    """d log(upper bound) / d log(size of a block), for each block and matrix of a batch.

    A block of size s acts as a block of size 1 with its columns of M multiplied by s. The upper
    bound is homogeneous, so the sensitivities of a matrix add up to 1, and none is negative.

    Parameters
    ----------
    M
        The matrix that Delta closes, complex or real (..., columns, rows), finite.
    structure
        Blocks of Delta.

    Returns
    -------
    Shape (..., blocks), 0 where the bound is 0. Central differences with a step of 1e-3 in the
    logarithm give an accuracy of about 1e-5; where the bound has a kink the result is the mean of
    its two slopes.

    Raises
    ------
    InputError
        M does not fit the structure or is not finite.
    """
    M = as_matrices(M, structure)
    factors = np.ones((2, len(structure), structure.rows))
    for k, row in enumerate(structure.row_slices):
        factors[:, k, row] = np.exp([[LOG_SIZE_STEP], [-LOG_SIZE_STEP]])
    value = upper_bound(M[..., None, None, :, :] * factors[..., None, :], structure).value
    larger, smaller = value[..., 0, :], value[..., 1, :]
    positive = (larger > 0) & (smaller > 0)
    ratio = np.where(positive, larger, 1.0) / np.where(positive, smaller, 1.0)
    change: NDArray[np.float64] = np.log(ratio) / (2 * LOG_SIZE_STEP)
    return change
