"""Checks of a matrix model against the plants that it must contain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.certificate import THIS_SYSTEM, Check, worst
from workbench.heavy_types import StateSpace
from workbench.second_opinion.responses import plain_response, tried_frequencies, upper_closed
from workbench.systems.realisation import worst_pole
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import MatrixResponses
from workbench.uncertainty.matrix_sets.shapes import Shape, ctranspose

REALISED = 1e-6
"""Largest norm of Delta beyond 1, and distance of a plant, in the second opinion."""


def stays_stable(name: str, system: StateSpace) -> Check:
    """Whether the poles of a system are inside the region of stability."""
    beyond = worst_pole(system)[1]
    statement = "how far a pole is beyond the boundary of stability, negative"
    return Check(name, statement, beyond, -np.finfo(float).tiny, over=THIS_SYSTEM)


def off_shape(response: Array, shape: Shape) -> float:
    """Largest entry of a weight's response (F, n, n) that is not of its shape, relative."""
    if shape == "full":
        return 0.0
    unit = np.eye(response.shape[-1])
    off = response * (1 - unit)
    if shape == "scalar":
        off = response - response[:, :1, :1] * unit
    return float(np.abs(off).max() / np.abs(response).max())


def semidefinite(responses: MatrixResponses, X: Array, model: MatrixModel) -> Check:
    """Containment by the least eigenvalue of [[L, X], [X^*, R]], scaled to a unit diagonal."""
    W_1, W_2 = (plain_response(W, responses.omega) for W in (model.W_1, model.W_2))
    L, R = W_1 @ ctranspose(W_1), ctranspose(W_2) @ W_2
    L, R = (np.repeat(each[:, None], X.shape[1], axis=1) for each in (L, R))
    top, bottom = np.concatenate([L, X], axis=3), np.concatenate([ctranspose(X), R], axis=3)
    whole = np.concatenate([top, bottom], axis=2)
    root = np.sqrt(np.einsum("fkii->fki", whole).real)
    least = np.linalg.eigvalsh(whole / root[..., None] / root[..., None, :])[..., 0]
    value, where = worst(-least, responses.numbered)
    statement = "smallest eigenvalue of [[L, X], [X^*, R]] of unit diagonal, below zero"
    return Check("semidefinite", statement, value, REALISED, where)


def plants_made(responses: MatrixResponses, deltas: Array, model: MatrixModel) -> Check:
    """The model, closed by each plant's Delta (F, N, ., .), is the plant."""
    whole, given = plain_response(model.system, responses.omega), responses.values
    made = np.stack([upper_closed(whole, deltas[:, k]) for k in range(deltas.shape[1])], axis=1)
    size = np.maximum(np.linalg.norm(given, axis=(2, 3)), np.finfo(float).tiny)
    value, where = worst(np.linalg.norm(made - given, axis=(2, 3)) / size, responses.numbered)
    statement = "distance of a plant from the model closed by its Delta, relative"
    return Check("plants made", statement, value, REALISED, where)


def tried_everywhere(responses: MatrixResponses, deltas: Sequence[StateSpace]) -> Check:
    """Norms of Delta of known plants at many frequencies."""
    peaks = []
    for delta in deltas:
        tried = tried_frequencies(delta.poles(), float(delta.dt or 0.0))
        peaks.append(np.linalg.norm(plain_response(delta, tried), 2, axis=(1, 2)).max())
    value, where = worst(np.array(peaks) - 1, lambda i: f"plant {responses.plants[i[0]]}")
    statement = "largest norm of a Delta at frequencies tried, less 1"
    return Check("everywhere", statement, value, REALISED, where)
