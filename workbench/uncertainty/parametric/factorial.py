"""Responses of a parametric model over a full factorial of its deltas, one parameter at a time.

The deltas of a parameter close their own channels of the model's response before the next
parameter's do, so what parameters have in common is computed once: a combination of P parameters
costs about two operations on scalars instead of a system of equations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.systems.frequency_response import frequency_response
from workbench.uncertainty.parametric.model import ParametricModel


def factorial_response(model: ParametricModel, omega: ArrayLike, deltas: ArrayLike) -> Array:
    """Responses of every combination of `deltas` (L,) of the P parameters.

    Parameters
    ----------
    omega
        [rad/s] (F,). All combinations are held at once: take few frequencies at a time.

    Returns
    -------
    Matrix
        (L, ..., L, F, outputs, inputs), P axes in the order of the parameters; flattened, the
        combinations come in the order of `levels`. Infinite or NaN where not well posed.
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
        # With one channel all is scalar, and arrays divide faster than equations are solved.
        change = back * (drive / loop) if n == 1 else back @ np.linalg.solve(loop, drive)
        M = M[..., n:, n:] + change
    return M
