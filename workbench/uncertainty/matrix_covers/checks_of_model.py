"""Checks of a matrix model against the plants that it must contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import StateSpace
from workbench.certificate import Check, worst_value
from workbench.certify.eigenvalues import pole_discs
from workbench.certify.rounding import exact
from workbench.certify.stability import balanced_states, stability_check
from workbench.second_opinion.responses import plain_response, tried_frequencies, upper_closed
from workbench.uncertainty.matrix_covers.model import MatrixModel
from workbench.uncertainty.matrix_covers.responses import MatrixResponses
from workbench.uncertainty.matrix_covers.sets.shapes import WeightShape, ctranspose

REALISED = 1e-6
"""Tolerance of the second opinion: excess of a norm of Delta over 1, and distance of a plant.
Realisations in doubles lose half of the digits where orders are high. With half of it a true cover
may be contradicted; double overlooks 2e-6.
"""


def stays_stable(name: str, system: StateSpace) -> Check:
    """Check that the poles of a system are proven to lie inside the region of stability."""
    return replace(stability_check(system), name=name, where="")


def unstable_poles(system: StateSpace) -> int:
    """Number of poles that are not proven to lie inside the region of stability.

    A pole on the boundary, such as an integrator's, is never proven to lie inside, however it is
    rounded.
    """
    if stability_check(system).holds:
        return 0
    discs = pole_discs(exact(balanced_states(np.asarray(system.A, dtype=float))[0]))
    beyond = np.abs(discs.centre) - 1.0 if system.dt else discs.centre.real
    return int((beyond + discs.radius >= 0.0).sum())


def off_shape(response: Array, shape: WeightShape) -> float:
    """Largest relative size of entries of a weight's response (F, n, n) outside its shape."""
    if shape == "full":
        return 0.0
    unit = np.eye(response.shape[-1])
    off = response * (1 - unit)
    if shape == "scalar":
        off = response - response[:, :1, :1] * unit
    return float(np.abs(off).max() / np.abs(response).max())


def semidefinite(responses: MatrixResponses, X: Array, model: MatrixModel) -> Check:
    """Check of containment by the least eigenvalue of [[L, X], [X^*, R]], scaled to a unit
    diagonal.
    """
    W_1, W_2 = (plain_response(W, responses.omega) for W in (model.W_1, model.W_2))
    L, R = W_1 @ ctranspose(W_1), ctranspose(W_2) @ W_2
    L, R = (np.repeat(each[:, None], X.shape[1], axis=1) for each in (L, R))
    top, bottom = np.concatenate([L, X], axis=3), np.concatenate([ctranspose(X), R], axis=3)
    whole = np.concatenate([top, bottom], axis=2)
    root = np.sqrt(np.einsum("fkii->fki", whole).real)
    least = np.linalg.eigvalsh(whole / root[..., None] / root[..., None, :])[..., 0]
    value, where = worst_value(-least, responses.numbered)
    statement = "smallest eigenvalue of [[L, X], [X^*, R]] of unit diagonal, below zero"
    return Check("semidefinite", statement, value, REALISED, where=where)


def plants_made(responses: MatrixResponses, deltas: Array, model: MatrixModel) -> Check:
    """Check that the model, closed with each plant's Delta (F, N, ., .), gives the plant."""
    whole, given = plain_response(model.system, responses.omega), responses.values
    made = np.stack([upper_closed(whole, deltas[:, k]) for k in range(deltas.shape[1])], axis=1)
    size = np.maximum(np.linalg.norm(given, axis=(2, 3)), np.finfo(float).tiny)
    value, where = worst_value(np.linalg.norm(made - given, axis=(2, 3)) / size, responses.numbered)
    statement = "distance of a plant from the model closed by its Delta, relative"
    return Check("plants made", statement, value, REALISED, where=where)


def tried_everywhere(responses: MatrixResponses, deltas: Sequence[StateSpace]) -> Check:
    """Check of the norms of Delta of known plants at many frequencies."""
    peaks = []
    for delta in deltas:
        tried = tried_frequencies(delta.poles(), float(delta.dt or 0.0))
        peaks.append(np.linalg.norm(plain_response(delta, tried), 2, axis=(1, 2)).max())
    value, where = worst_value(np.array(peaks) - 1, lambda i: f"plant {responses.plants[i[0]]}")
    statement = "largest norm of a Delta at frequencies tried, less 1"
    return Check("everywhere", statement, value, REALISED, where=where)
