"""Modes on the imaginary axis that no measurement shows, and the signals that drive them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space, schur, solve_continuous_are

from workbench._core.arrays import EPS, RealArray
from workbench.systems.balancing import axis_rounding, balanced, null_states_first, speed
from workbench.systems.hidden_states import ZERO_ROUNDING
from workbench.systems.standard_plant import StandardPlant

AXIS_SHARE = 1e-8
"""A hidden mode lies on the axis if its real part is at most this share of its size."""
DRIVEN_SHARE = 1e-12
"""Largest relative part of a mode's drive that may come from neither measurements nor controls."""


class HiddenPoleError(Exception):
    """A hidden pole that no controller can share with a weight; it is ``unstable`` or on the
    axis.
    """

    def __init__(self, pole: complex, unstable: bool) -> None:
        super().__init__(pole, unstable)
        self.pole, self.unstable = pole, unstable


class Shared(NamedTuple):
    """A plant whose measurements show every mode on the axis, and its relation to the given plant.

    The ``copy`` of the modes has inputs (y, u') and outputs (u, y'); it is None if the modes only
    repeat others. ``poles`` are the poles that were hidden.
    """

    plant: StandardPlant
    copy: StandardPlant | None = None
    poles: tuple[complex, ...] = ()


def modes_shown(plant: StandardPlant, copied: int = 0) -> Shared:
    """A continuous plant whose measurements show every mode on the axis.

    The first states of the result are those of the copy. The first ``copied`` states of the plant
    already belong to a controller and not to a weight, so they must not be hidden.

    Raises
    ------
    HiddenPoleError
        A hidden mode is unstable, or lies on the axis and is not driven by measurements.
    """
    rate = speed(plant.A, plant.B, plant.C)
    root = np.sqrt(rate)
    A, B, C = balanced(plant.A / rate, plant.B / root, plant.C / root)
    scaled = replace(plant, A=A, B=B, C=C)
    V = _hidden_axis_modes(scaled, rate)
    if not V.shape[1]:
        return Shared(plant)
    Lambda, W = V.T @ A @ V, _orthogonal_complement(V)
    poles = tuple(rate * pole for pole in np.linalg.eigvals(Lambda).astype(complex).tolist())
    if np.abs(V[:copied]).max(initial=0.0) > DRIVEN_SHARE:
        raise HiddenPoleError(poles[0], False)
    for T, L, M in _drives(scaled, V, W):
        # Only the part that y and u reach ever differs from 0.
        R = _orthogonal_complement(_unobservable(Lambda.T, np.hstack([L, M]).T))
        drive = _Drive(T, R.T @ L, R.T @ M)
        if not _unobservable(R.T @ Lambda.T @ R, drive.L.T).shape[1]:
            break
    else:
        raise HiddenPoleError(poles[0], False)
    # The new states are R^T (V^T x + T W^T x), where R spans the remaining part, and W^T x.
    inward = np.vstack([R.T @ (V.T + T @ W.T), W.T])
    outward = np.hstack([V @ R, W - V @ T])
    scaled, copy = _plant_and_copy(
        replace(scaled, A=inward @ A @ outward, B=inward @ B, C=C @ outward), drive
    )
    units = {"A": rate, "B": root, "C": root}
    plant, kept = (
        replace(one, **{name: unit * getattr(one, name) for name, unit in units.items()})
        for one in (scaled, copy)
    )
    return Shared(plant, kept if len(R.T) else None, poles)


def _plant_and_copy(plant: StandardPlant, drive: _Drive) -> tuple[StandardPlant, StandardPlant]:
    """A plant that shows its first states, which only y and u drive, and the copy of these
    states.
    """
    q = len(drive.L)
    _, L, M = drive
    Lambda, columns, leaving = balanced(plant.A[:q, :q], np.hstack([L, M]), plant.C1[:, :q])
    p, m = L.shape[1], M.shape[1]
    L, M = columns[:, :p], columns[:, p:]
    F = L.T @ solve_continuous_are(Lambda, L, np.eye(q), np.eye(p)) if q else np.zeros((p, 0))
    A, B, C = plant.A.copy(), plant.B.copy(), plant.C.copy()
    A[:q, :q], A[q:, :q], A[:q, q:] = Lambda, 0.0, L @ plant.C2[:, q:]
    B[:q] = np.hstack([L @ plant.D21, L @ plant.D22 + M])
    C[: len(leaving), :q], C[len(leaving) :, :q] = leaving, F
    direct = np.block([[np.zeros((m, p)), np.eye(m)], [np.eye(p), np.zeros((p, m))]])
    copy = StandardPlant(Lambda, columns, np.vstack([np.zeros((m, q)), F]), direct, m, p)
    return replace(plant, A=A, B=B, C=C), copy


def _hidden_axis_modes(plant: StandardPlant, rate: float) -> RealArray:
    """Orthonormal basis (n, q) of the modes on the axis that no measurement shows."""
    A = plant.A
    N = _unobservable(A, plant.C2)
    if not N.shape[1]:
        return N
    rounding, hidden = axis_rounding(A), N.T @ A @ N
    Q, T, k = null_states_first(hidden, rounding)
    rest = T[k:, k:]

    def beyond(real: float, imag: float = 0.0) -> bool:
        return real >= -AXIS_SHARE * abs(complex(real, imag)) - rounding

    if len(rest):
        _, turn, more = schur(rest, sort=beyond)
        Q[:, k:] = Q[:, k:] @ turn
        k += more
    V: RealArray = N @ Q[:, :k]
    for mode in np.linalg.eigvals((V.T @ A @ V)[len(T) - len(rest) :, len(T) - len(rest) :]):
        if mode.real > AXIS_SHARE * abs(mode) + rounding:
            raise HiddenPoleError(complex(mode) * rate, True)
    return V


class _Drive(NamedTuple):
    """T, L and M for which L y + M u drives V^T x + T W^T x."""

    T: RealArray
    L: RealArray
    M: RealArray


def _drives(plant: StandardPlant, V: RealArray, W: RealArray) -> Iterator[_Drive]:
    """Possible drives of the modes V, the simplest first; W is an orthonormal basis of the other
    states.

    The first one has no other states, the second one no controls (nothing drives a mode that the
    plant contains twice), and the third one has everything.
    """
    Lambda, w = V.T @ plant.A @ V, plant.B1.shape[1]
    into, turned = (np.hstack([X.T @ plant.A @ W, X.T @ plant.B]) for X in (V, W))
    shown = np.hstack([plant.C2 @ W, plant.D21, plant.D22])
    kept = np.eye(W.shape[1], into.shape[1])
    (q, x), p = (V.shape[1], W.shape[1]), len(shown)
    for states, columns in ((0, x + w), (x, into.shape[1]), (x, x + w)):
        part = slice(columns)
        # Solve into + T turned - Lambda T kept = L shown, with the rows stacked one after another.
        parts = [np.kron(np.eye(q), shown[:, part].T)]
        if states:
            turn = np.kron(np.eye(q), turned[:, part].T)
            parts.append(np.kron(Lambda, kept[:, part].T) - turn)
        matrix = np.hstack(parts)
        found = np.linalg.lstsq(matrix, into[:, part].ravel(), rcond=ZERO_ROUNDING * EPS)[0]
        size = float(np.linalg.norm(into) + np.linalg.norm(Lambda) * (1 + np.linalg.norm(found)))
        missed = np.linalg.norm(matrix @ found - into[:, part].ravel())
        if missed <= DRIVEN_SHARE * size:
            L = _without_rounding(np.asarray(found[: q * p].reshape(q, p)), shown, size)
            T = found[q * p :].reshape(q, states) if states else np.zeros((q, x))
            M = (into + T @ turned - L @ shown)[:, x + w :]
            yield _Drive(np.asarray(T), L, _without_rounding(M, plant.B2.T, size))


def _without_rounding(M: RealArray, rows: RealArray, whole: float) -> RealArray:
    """M without entries that are rounding errors in a sum of size `whole`; M's columns multiply
    `rows`.
    """
    sizes = np.linalg.norm(rows, axis=1)
    return np.where(np.abs(M) * sizes > DRIVEN_SHARE * whole, M, 0.0)


def _unobservable(A: RealArray, C: RealArray) -> RealArray:
    """Orthonormal basis (n, k) of the states that C exp(A t) does not show."""
    small = ZERO_ROUNDING * EPS * len(A) * float(max(np.linalg.norm(A), np.linalg.norm(C)))
    N = np.eye(len(A))
    shown = C
    while N.shape[1]:
        kept = _null_basis(shown @ N, small)
        if kept.shape[1] == N.shape[1]:
            return N
        N = N @ kept
        shown = A - N @ (N.T @ A)  # the part of A that leaves the space of N
    return N


def _null_basis(M: RealArray, small: float) -> RealArray:
    """Orthonormal basis of the null space of M; it consists of unit vectors if these span the
    space.
    """
    zero = np.abs(M).max(axis=0, initial=0.0) <= small
    _, values, Vh = np.linalg.svd(M)
    rank = int((values > small).sum())
    if int(zero.sum()) == M.shape[1] - rank:
        return np.eye(M.shape[1])[:, zero]
    return np.asarray(Vh[rank:].T)


def _orthogonal_complement(V: RealArray) -> RealArray:
    """Orthonormal basis of the complement of the columns of V (n, k)."""
    return null_space(V.T) if V.shape[1] else np.eye(len(V))
