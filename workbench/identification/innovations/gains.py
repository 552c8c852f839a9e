"""Gains, offsets and stable poles for models whose regression does not provide them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgError, schur, solve_discrete_are

from workbench._core.arrays import RealArray
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.recursions import sensitivity_rows
from workbench.identification.innovations.regression import triangle_of_blocks

LEAST_COVARIANCE = 1e-12
"""Covariance added to that of the noise, scaled to trace 1, since some states may have no noise."""
INPUT_BLOCK = 512
"""Samples whose regression rows are computed at a time."""


def innovation_gain(A: RealArray, C: RealArray, covariance: RealArray) -> RealArray | None:
    """Gain K (n, ny) of the stationary Kalman filter; None if there is none.

    ``covariance`` (n + ny, n + ny) is that of state and output noise; its scale does not matter.
    """
    n = len(A)
    size = float(np.trace(covariance))
    if not np.isfinite(size):
        return None
    noise = covariance / size if size > 0 else np.zeros_like(covariance)
    noise = noise + LEAST_COVARIANCE * np.eye(len(noise))
    Q, S, R = noise[:n, :n], noise[:n, n:], noise[n:, n:]
    try:
        P = solve_discrete_are(A.T, C.T, Q, R, s=S)
    except (LinAlgError, ValueError):
        return None
    gain = np.asarray(np.linalg.solve(C @ P @ C.T + R, (A @ P @ C.T + S).T).T)
    radius = np.max(np.abs(np.linalg.eigvals(A - gain @ C)), initial=0.0)
    return gain if np.isfinite(gain).all() and radius < 1 else None


def operating_point(
    A: RealArray, B: RealArray, C: RealArray, D: RealArray, forcing: RealArray, level: RealArray
) -> tuple[RealArray, RealArray]:
    """Offsets of u and y for the constants in x+ = A x + B u + forcing, y = C x + D u + level.

    The offset of u is as small as possible; it is needed if A has a pole at 1, since then a
    constant causes a drift.
    """
    n = len(A)
    rows = np.hstack([np.eye(n) - A, B])
    found = np.asarray(np.linalg.lstsq(rows, forcing, rcond=1e-10)[0], dtype=float)
    rest, push = found[:n], found[n:]
    # x = x' + rest: x'+ = A x' + B (u + push), y = C x' + D (u + push) + (C rest + level - D push)
    return -push, C @ rest + level - D @ push


def with_inputs(
    model: InnovationsModel, pieces: list[tuple[RealArray, RealArray]], direct: bool = True
) -> InnovationsModel | None:
    """The model with the B, D and offset of y whose simulation fits the experiments best.

    The result is None if the simulation overflows.

    If A has an unstable mode, one-step predictions are used instead of the simulation. The initial
    state of each experiment is free. ``direct`` allows inputs to act within the sample.
    """
    n, nu, ny = model.order, model.B.shape[1], len(model.C)
    size = n * n + n * nu + ny * n + ny * nu + n * ny + nu + ny + n
    end_a, end_b = n * n, n * n + n * nu
    end_c, end_d = end_b + ny * n, end_b + ny * n + ny * nu
    end_k = end_d + n * ny
    columns = np.r_[end_a:end_b, end_c : end_d if direct else end_c, end_k + nu : end_k + nu + ny]
    count = len(columns) + n
    still = replace(model, B=np.zeros((n, nu)), D=np.zeros((ny, nu)))
    grows = model.radius > 1 + 1 / max(len(u) for u, _ in pieces)
    matrices = still.matrices(model.K if grows else np.zeros((n, ny)))
    found = np.zeros((0, len(columns) + 1))

    def blocks(drive: RealArray, measured: RealArray) -> Iterator[RealArray]:
        x, moved = np.zeros(n), np.zeros((n, n * (n + nu + ny)))
        shifted, free = np.zeros((n, nu + ny)), np.eye(n)
        for first in range(0, len(drive), INPUT_BLOCK):
            part = slice(first, first + INPUT_BLOCK)
            errors = np.empty((len(drive[part]), ny))
            rows = np.empty((*errors.shape, size))
            sensitivity_rows(
                *matrices, x, moved, shifted, free, drive[part], measured[part], errors, rows
            )
            flat = rows.reshape(-1, size)
            yield np.column_stack([flat[:, -n:], flat[:, columns], errors.ravel()])

    for u, y in pieces:
        drive, measured = model.driven_part(u, y)
        signals = drive - model.u_offset, np.ascontiguousarray(measured - model.y_offset)
        # The initial state of an experiment has its own columns, which are eliminated first.
        factor = triangle_of_blocks(blocks(*signals), count + 1)
        found = np.asarray(np.linalg.qr(np.vstack([found, factor[n:, n:]]), mode="r"))
    with np.errstate(over="ignore"):
        scale = np.linalg.norm(found[:, :-1], axis=0)
    if not np.isfinite(found).all() or not np.isfinite(scale).all():
        return None
    scale[scale == 0] = 1.0
    theta = -np.linalg.lstsq(found[:, :-1] / scale, found[:, -1], rcond=None)[0] / scale
    B = theta[: n * nu].reshape(n, nu)
    D = theta[n * nu : -ny].reshape(ny, nu) if direct else np.zeros((ny, nu))
    return replace(model, B=B, D=D, y_offset=model.y_offset + theta[-ny:])


def inside_circle(A: RealArray, radius: float) -> RealArray:
    """A with eigenvalues outside a circle reflected into it.

    An eigenvalue of modulus r > radius gets the modulus min(radius, 1 / r). The basis of the Schur
    form is kept, so that the other modes are unchanged.
    """
    triangle, basis = schur(A.astype(complex), output="complex")
    values = np.diag(triangle)
    size = np.abs(values)
    goal = np.minimum(radius, 1.0 / np.maximum(size, 1e-300))
    factor = np.where(size > radius, goal / np.maximum(size, 1e-300), 1.0)
    moved = triangle.copy()
    np.fill_diagonal(moved, values * factor)
    return np.asarray((basis @ moved @ basis.conj().T).real)
