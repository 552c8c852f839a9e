"""The change of a model's matrices with a parameter, as a product of full-rank factors."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench.errors import InputError
from workbench.input_checks import as_array

PARAMETER_RANK_SHARE = 1e-12
"""A singular value of a parameter's matrix counts as 0 below this share of the largest."""


def rank_factors(
    name: str, parts: tuple[ArrayLike | None, ...], states: int, outputs: int, controls: int
) -> tuple[Array, Array]:
    """Factors L (n + p, k) and R (k, n + m) of full rank k, with L R = [dA dB; dC dD].

    Parameters
    ----------
    name
        Name of the parameter fault, for messages.
    parts
        The matrices dA (n, n), dB (n, m), dC (p, n) and dD (p, m); None stands for zero.
    states, outputs, controls
        The model's numbers n, p and m.

    Raises
    ------
    InputError
        A matrix has another shape or entries that are not finite, or all four are zero.
    """
    n, p, m = states, outputs, controls
    shapes = {"dA": (n, n), "dB": (n, m), "dC": (p, n), "dD": (p, m)}
    given: list[Array] = []
    for (label, shape), part in zip(shapes.items(), parts, strict=True):
        matrix = np.zeros(shape) if part is None else as_array(part, f"{label} of {name}")
        if matrix.shape != shape:
            raise InputError(
                f"{label} of fault {name!r} has shape {matrix.shape}; the model has {n} states, "
                f"{p} outputs and {m} controls: {shape} is needed"
            )
        if not np.isfinite(matrix).all():
            raise InputError(f"{label} of fault {name!r} has entries that are not finite")
        given.append(matrix)
    dM = np.block([given[:2], given[2:]])
    if not dM.any():
        raise InputError(f"fault {name!r} changes nothing: dA, dB, dC and dD are zero")
    U, sizes, V = np.linalg.svd(dM)
    rank = int((sizes > PARAMETER_RANK_SHARE * sizes[0]).sum())
    if rank == 1:  # one column of a matrix stays what it was, as I_i in equation 7.2
        pivot = int(np.abs(dM).sum(axis=0).argmax())
        L = dM[:, [pivot]]
        return L, np.linalg.lstsq(L, dM, rcond=None)[0]
    return U[:, :rank], sizes[:rank, None] * V[:rank]
