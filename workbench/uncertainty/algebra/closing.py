"""A system closed with values of its perturbation; all states are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.elements import Element


class IllPosedError(InputError):
    """A system divides by zero at some values of its uncertain elements."""


def closed_above(
    whole: StateSpace, deltas: Sequence[tuple[Any, int, Element]], values: Mapping[str, Any]
) -> StateSpace:
    """F_u(whole, Delta), where the delta of each element, a number or dynamics, occurs `times`
    times.

    Raises InputError for a loop that overflows doubles, and IllPosedError for a singular one;
    ``values`` is the text for the values in the message.
    """
    import control

    if not deltas:
        return whole
    parts = [
        _repeated(delta, times, len(one.channels))
        if isinstance(delta, control.StateSpace)
        else control.ss([], [], [], delta * np.eye(times * len(one.channels)))
        for delta, times, one in deltas
    ]
    Delta = control.append(*parts) if len(parts) > 1 else parts[0]
    r = Delta.ninputs
    loop = np.eye(r) - whole.D[:r, :r] @ Delta.D
    if not np.isfinite(loop).all():
        raise InputError(f"the system overflows doubles at {values}")
    if np.linalg.cond(loop) > 1e13:
        raise IllPosedError(f"the system is not well posed at {values}: it divides by zero there")
    return _upper(whole, Delta, r)


def _repeated(delta: StateSpace, times: int, size: int) -> StateSpace:
    """Dynamics that occur several times, with channels ordered (channel, occurrence), padded to
    `size`.
    """
    one = np.eye(times)
    B, C = np.zeros((delta.nstates, size)), np.zeros((size, delta.nstates))
    D = np.zeros((size, size))
    B[:, : delta.ninputs], C[: delta.noutputs] = delta.B, delta.C
    D[: delta.noutputs, : delta.ninputs] = delta.D
    parts = [np.asarray(np.kron(part, one)) for part in (delta.A, B, C, D)]
    return realisation((parts[0], parts[1], parts[2], parts[3]), 0.0)


def _upper(whole: StateSpace, Delta: StateSpace, r: int) -> StateSpace:
    """F_u(whole, Delta) with Delta closing the first r channels, all states kept."""
    n, k = whole.nstates, Delta.nstates
    A, B, C, D = whole.A, whole.B, whole.C, whole.D
    # y = D11 w + ..., w = Delta y: w = (I - Dd D11)^-1 (Cd xd + Dd (C1 x + D12 u))
    left = np.linalg.inv(np.eye(r) - Delta.D @ D[:r, :r])
    w_x, w_d, w_u = left @ Delta.D @ C[:r], left @ Delta.C, left @ Delta.D @ D[:r, r:]
    y_x, y_d, y_u = C[:r] + D[:r, :r] @ w_x, D[:r, :r] @ w_d, D[:r, r:] + D[:r, :r] @ w_u
    joined_A = np.block(
        [[A + B[:, :r] @ w_x, B[:, :r] @ w_d], [Delta.B @ y_x, Delta.A + Delta.B @ y_d]]
    )
    joined_B = np.vstack([B[:, r:] + B[:, :r] @ w_u, Delta.B @ y_u])
    joined_C = np.hstack([C[r:] + D[r:, :r] @ w_x, D[r:, :r] @ w_d])
    joined_D = D[r:, r:] + D[r:, :r] @ w_u
    assert joined_A.shape == (n + k, n + k)
    return realisation((joined_A, joined_B, joined_C, joined_D), whole.dt)
