"""Responses of a parametric model for all combinations of given deltas of its parameters.

The parameters are closed one after the other: first the channels of the first parameter with all
its deltas, then those of the second, and so on. So computations that several combinations share are
done only once. A combination costs about two scalar operations instead of the solution of a system
of equations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array
from workbench.systems.frequency_response import frequency_response
from workbench.uncertainty.parametric_models.model import ParametricModel


def factorial_response(model: ParametricModel, omega: ArrayLike, deltas: ArrayLike) -> Array:
    """Responses for every combination of the same `deltas` (L,) of all P parameters.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s]. The result needs memory for all combinations, so take few
        frequencies at a time.
    deltas
        Normalised deviations (L,) that each parameter takes.

    Returns
    -------
    Matrix
        (L, ..., L, F, outputs, inputs), with P axes in the order of the parameters; flattened, the
        combinations are in the order of `level_deltas`. Values are infinite or NaN where the model
        is not well posed.

    Examples
    --------
    >>> from workbench.uncertainty import Parameter, factorial_response, parametric_lft
    >>> def lag(gain):
    ...     return [[-1.0]], [[gain]], [[1.0]], [[0.0]]
    >>> model = parametric_lft(lag, [Parameter("gain", 2.0, 0.5)], inputs="u", outputs="y")
    >>> factorial_response(model, [0.0], [-1.0, 1.0]).real.ravel().round(6).tolist()
    [1.0, 3.0]
    """
    system, points = model.system, 1j * np.atleast_1d(np.asarray(omega, dtype=float))
    M = frequency_response(
        np.block([[system.A, system.B], [system.C, system.D]]), model.states, points
    )
    steps = np.asarray(deltas, dtype=float)[:, None, None, None]
    for parameter in model.parameters:
        _, n = model.repetitions[parameter.name]
        M = M[..., None, :, :, :]
        drive, back = steps * M[..., :n, n:], M[..., n:, :n]
        loop = np.eye(n) - steps * M[..., :n, :n]
        # With one channel the loop is scalar, and dividing arrays is faster than solving equations.
        change = back * (drive / loop) if n == 1 else back @ np.linalg.solve(loop, drive)
        M = M[..., n:, n:] + change
    return M
