"""LQG in one call: the H2 controller of a plant with a quadratic cost and white noises."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench.errors import InputError, SolverError
from workbench.input_checks import as_array, is_real, need_sampling_time
from workbench.solution import solve
from workbench.synthesis.h2.program import H2Controller, H2Synthesis
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.joints import system_of
from workbench.systems.realisation import realisation

SYMMETRY = 1e-9
"""Asymmetry of a weight, or a negative eigenvalue, that counts as rounding, with the diagonal
scaled to 1.
"""
DIAGONAL_ROUNDING = 1e-14
"""An entry of a weight's diagonal up to this share of the largest entry, times the number of
entries, may be rounding.
"""


def lqg(
    plant: Any,
    Q: ArrayLike,
    R: ArrayLike,
    W: ArrayLike,
    V: ArrayLike,
    *,
    recovery: float = 0.0,
) -> H2Controller:
    """The LQG controller u = K y (positive feedback) of a plant, certified.

    The plant is x' = A x + B u + w, y = C x + D u + v, with white noises w and v of covariance
    (continuous time: intensity) W and V. K minimises the mean of x' Q x + u' R u; the square of the
    answer's ``norm`` is this mean. In sampled time u depends on the newest y without delay.

    Parameters
    ----------
    plant
        StateSpace with n states, m inputs and p outputs.
    Q, R, W, V
        Weights and covariances (n, n), (m, m), (n, n) and (p, p), symmetric; Q and W positive
        semidefinite, R and V positive definite. A number stands for this number times the identity.
    recovery
        Loop transfer recovery: covariance of additional white noise at the plant's inputs. As it
        grows, the loop transfer function at the plant's input approaches that of state feedback,
        for plants without zeros right of the axis (J. C. Doyle, G. Stein, IEEE Trans. Automatic
        Control 26 (1981) 4-16). The cost in the answer includes this noise.

    Raises
    ------
    InputError
        The plant has no states of its own; a weight has another size, is not symmetric, or is not
        (semi)definite; or as in `H2Synthesis`.
    SolverError
        No valid controller was found; the message says why.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import lqg
    >>> G = control.ss([[0.0, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0)
    >>> answer = lqg(G, Q=[[1, 0], [0, 0]], R=1, W=[[0, 0], [0, 1]], V=1)
    >>> round(answer.norm**2, 4), answer.holds  # 6 sqrt(2)
    (8.4853, True)
    """
    import control

    if isinstance(system_of(plant, "plant"), control.TransferFunction):
        raise InputError(
            "plant must be a StateSpace: Q and W belong to its states, and a TransferFunction has "
            "none of its own; choose them by control.ss(plant)"
        )
    G = as_system(plant, "plant")
    need_sampling_time(G.dt, "plant")
    n, m, p = G.nstates, G.ninputs, G.noutputs
    of_x, of_u = _root(Q, n, "Q", "states"), _root(R, m, "R", "inputs", definite=True)
    noise, error = _root(W, n, "W", "states"), _root(V, p, "V", "outputs", definite=True)
    if not (is_real(recovery) and 0.0 <= recovery < np.inf):
        raise InputError(f"recovery is {recovery!r}; it must be a number of 0 or more")
    A, B, C, D = (np.asarray(getattr(G, name), dtype=float) for name in "ABCD")
    B1 = np.hstack([noise, np.sqrt(recovery) * B, np.zeros((n, p))])
    D21 = np.hstack([np.zeros((p, n)), np.sqrt(recovery) * D, error])
    matrices = (
        A,
        np.hstack([B1, B]),
        np.vstack([of_x, np.zeros((m, n)), C]),
        np.block(
            [
                [np.zeros((n, B1.shape[1])), np.zeros((n, m))],
                [np.zeros((m, B1.shape[1])), of_u],
                [D21, D],
            ]
        ),
    )
    program = H2Synthesis(GeneralisedPlant(realisation(matrices, float(G.dt or 0.0)), None, m, p))
    solution = solve(program)
    if solution.certificate is None:
        raise SolverError(solution.message)
    if not solution.certificate.valid:
        raise SolverError("; ".join(solution.certificate.failures))
    answer: H2Controller = solution.answer
    return answer


def _root(weight: ArrayLike, size: int, name: str, of: str, *, definite: bool = False) -> RealArray:
    """A symmetric root of a weight (size, size), or of a number times the identity."""
    given = as_array(weight, name)
    matrix = float(given) * np.eye(size) if given.ndim == 0 else np.asarray(given, dtype=float)
    if matrix.shape != (size, size):
        raise InputError(
            f"{name} has shape {given.shape}; for {size} {of} ({size}, {size}) is needed, or a "
            "number"
        )
    if not np.isfinite(matrix).all():
        raise InputError(f"{name} has entries that are not finite")
    scaled, units = _in_own_units(matrix, definite)
    if np.abs(scaled - scaled.T).max(initial=0.0) > SYMMETRY:
        raise InputError(f"{name} is not symmetric")
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2)
    least = float(values.min(initial=1.0))
    if least < -SYMMETRY or (definite and least <= SYMMETRY):
        kind = "definite" if definite else "semidefinite"
        own = np.linalg.eigvalsh((matrix + matrix.T) / 2)[0]
        why = f"its least eigenvalue is {own:.3g}" if least < 0.0 else "it is singular"
        raise InputError(f"{name} must be positive {kind}; {why}")
    root: RealArray = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T * units
    return root if name in ("Q", "R") else root.T


def _in_own_units(matrix: RealArray, definite: bool) -> tuple[RealArray, RealArray]:
    """The matrix (n, n) with its signals in units that make the diagonal 1, and these units (n,).

    Signals may have units as far apart as metres and nanometres. An entry of the diagonal that
    rounding alone may have left gives no unit: the largest one is used.
    """
    diagonal = np.diag(matrix)
    scale = float(np.abs(matrix).max(initial=0.0)) or 1.0
    rounding = DIAGONAL_ROUNDING * len(matrix) * scale
    units = np.sqrt(np.where(diagonal > (0.0 if definite else rounding), diagonal, scale))
    units[diagonal < -rounding] = np.sqrt(-diagonal[diagonal < -rounding])
    return matrix / units[:, None] / units, units
