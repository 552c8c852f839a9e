"""Sensitivity of an upper bound of mu to the size of each block."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import Array
from workbench.input_checks import as_matrices
from workbench.mu.upper.bound import upper_bound
from workbench.structure import Structure

LOG_SIZE_STEPS = 1e-3, 1e-4
"""Steps of the central difference in the logarithm of a block's size. The bound is smooth to about
1e-8. The second step is taken where the first one crosses a kink nearby. The error of a central
difference is about the square of the step, and the noise is 1e-8 over the step: both are below
1e-4. Half or double changes a fourth digit.
"""
SUM_TOLERANCE = 1e-4
"""Distance of the sum of a matrix's sensitivities from 1 that shows a kink within the step. The sum
is 1 up to the noise, 1e-5, where the bound is smooth. With half of it the second step is taken more
often; with double of it a kink may spoil a fourth digit.
"""


def bound_sensitivity(M: Any, structure: Structure) -> NDArray[np.float64]:
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
    logarithm give an accuracy of about 1e-5, and with a step of 1e-4, taken where the sum is not 1,
    one of about 1e-4. Where the bound has a kink the result is the mean of its two slopes; these
    means need not add up to 1.

    Raises
    ------
    InputError
        M does not fit the structure or is not finite.
    """
    M = as_matrices(M, structure)
    first, second = LOG_SIZE_STEPS
    change = _differences(M, structure, first)
    total = change.sum(-1)
    again = (total > 0) & (np.abs(total - 1) > SUM_TOLERANCE)
    if again.any():
        change[again] = _differences(M[again], structure, second)
    return change


def _differences(M: Array, structure: Structure, step: float) -> NDArray[np.float64]:
    """Central differences (..., blocks) of the logarithm of the bound; 0 where the bound is 0."""
    factors = np.ones((2, len(structure), structure.rows))
    for k, row in enumerate(structure.row_slices):
        factors[:, k, row] = np.exp([[step], [-step]])
    value = upper_bound(M[..., None, None, :, :] * factors[..., None, :], structure).value
    larger, smaller = value[..., 0, :], value[..., 1, :]
    positive = (larger > 0) & (smaller > 0)
    ratio = np.where(positive, larger, 1.0) / np.where(positive, smaller, 1.0)
    return np.asarray(np.log(ratio) / (2 * step))
