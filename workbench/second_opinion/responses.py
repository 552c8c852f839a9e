"""Responses of loops, closed at each frequency on its own: no closed-loop realisation is formed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance, schur

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor.effort import tries

NEAR_A_POLE = (-8.0, -4.0, -2.0, -1.0, -0.5, -0.2, 0.0, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Distances from a lightly damped pole's frequency at which responses are tried, in units of its
damping.
"""
NEAR_A_PEAK = tuple(np.linspace(-0.05, 0.05, 21))
"""Distances from the frequency of a peak at which responses are tried, as shares of it."""
LIGHT_DAMPING = 0.2
"""A pole is lightly damped if its real part is below this share of its size."""
SPREAD_FREQUENCIES = 60
"""Number of frequencies spread evenly, on a logarithmic scale, over the band of the poles."""
CLOSING_ROUNDING = 1e-12
"""Rounding of the responses of plant and controller, relative."""
ROUNDING_FACTOR = 10.0
"""Largest error of a response, in units of the difference between two ways to compute it."""
FREQUENCIES_AT_ONCE = 256
"""Number of frequencies whose matrices are held in memory together."""
ROWS_AT_ONCE = 16
"""Number of rows of a triangular form whose common part is computed in one product."""
TINY = float(np.finfo(float).tiny)
"""Smallest normal number."""
BITS = 512
"""Bits of a response that doubles cannot resolve."""
FEWEST_STATES = 60
"""Least number of states for which responses are computed by substitution in a triangular form."""
TRIANGLE_ROUNDING = 1e-6
"""Largest rounding of a triangular form, as a share of a pole's damping. This is a worst case; the
difference of two forms tells how much is really lost.
"""


def plain_response(system: Any, omega: RealArray) -> ComplexArray:
    """Response (F, outputs, inputs) of a StateSpace at `omega` [rad/s] (F,), infinity allowed."""
    A, scale = (
        matrix_balance(system.A, permute=False, separate=True)
        if len(system.A)
        else (
            np.zeros((0, 0)),
            (np.ones(0), None),
        )
    )
    scale = scale[0]
    B, C = np.asarray(system.B) / scale[:, None], np.asarray(system.C) * scale
    found = np.tile(np.asarray(system.D, dtype=complex), (len(omega), 1, 1))
    unit, fastest = np.eye(len(A)), max(float(np.abs(A).max(initial=0.0)), TINY)
    finite = np.flatnonzero(np.isfinite(omega))
    triangle = None
    if len(A) >= FEWEST_STATES and finite.size:
        triangle = _triangle(np.ascontiguousarray(A).tobytes(), len(A), bool(system.dt))
    if triangle is not None:
        T, Q = triangle
        B, C = Q.conj().T @ B, C @ Q
    for start in range(0, len(finite), FREQUENCIES_AT_ONCE):
        part = finite[start : start + FREQUENCIES_AT_ONCE]
        s = np.exp(1j * omega[part] * system.dt) if system.dt else 1j * omega[part]
        if triangle is not None:
            found[part] += C @ _substituted(T, B, s)
            continue
        time = 2.0 ** -np.round(np.log2(np.maximum(np.abs(s), fastest)))[:, None, None]
        moved = (s[:, None, None] * unit - A) * time  # an elimination may lose large pivots
        try:
            found[part] += C @ np.linalg.solve(moved, B * time + 0j)
        except np.linalg.LinAlgError:  # at one frequency doubles cannot tell the point from a pole
            found[part] = [precise_response(system, one) for one in omega[part].tolist()]
    return found


def precise_response(system: Any, omega: float) -> ComplexArray:
    """As `plain_response` at one frequency [rad/s], in BITS bits; infinite at a pole."""
    import flint

    with flint.ctx.workprec(BITS):
        A, B, C, D = (
            flint.acb_mat(rows, columns, np.asarray(part, dtype=complex).ravel().tolist())
            for part in (system.A, system.B, system.C, system.D)
            for rows, columns in [np.shape(part)]
        )
        place = flint.acb(0, flint.arb(omega) * flint.arb(float(system.dt or 1.0)))
        s = place.exp() if system.dt else place
        moved = s * flint.acb_mat(np.eye(system.nstates).tolist()) - A
        try:
            entries = [complex(entry.mid()) for entry in (D + C * moved.solve(B)).entries()]
        except ZeroDivisionError:
            entries = [complex(math.inf)] * np.size(system.D)
    return np.reshape(entries, np.shape(system.D))


@lru_cache(maxsize=4)
def _triangle(entries: bytes, n: int, sampled: bool) -> tuple[ComplexArray, ComplexArray] | None:
    """The triangular form T of A = Q T Q^H; None if rounding may hide a lightly damped pole.

    The form has rounding errors of the size of the largest entry, and the response has them divided
    by the poles' distance from the boundary of stability. The form of the transposed matrix is
    rounded differently.
    """
    A = np.frombuffer(entries).reshape(n, n)
    T, Q = schur(A.astype(complex), output="complex")
    poles = np.diagonal(T)
    distance = np.abs(np.abs(poles) - 1.0 if sampled else poles.real)
    rounding = n * np.finfo(float).eps * float(np.abs(A).max())
    return (T, Q) if rounding <= TRIANGLE_ROUNDING * distance.min() else None


def _substituted(T: ComplexArray, B: Any, s: Any) -> ComplexArray:
    """(s I - T)^-1 B (F, n, r) for an upper triangular T (n, n), at s (F,)."""
    (n, r), F = B.shape, len(s)
    X = np.empty((n, F, r), complex)
    for low in reversed(range(0, n, ROWS_AT_ONCE)):  # first the part that all rows of a block share
        high = min(low + ROWS_AT_ONCE, n)
        shared = (T[low:high, high:] @ X[high:].reshape(n - high, F * r)).reshape(-1, F, r)
        for i in reversed(range(low, high)):
            own = (T[i, i + 1 : high] @ X[i + 1 : high].reshape(high - 1 - i, F * r)).reshape(F, r)
            X[i] = (B[i] + shared[i - low] + own) / (s - T[i, i])[:, None]
    return np.moveaxis(X, 0, 1)


def lower_closed(P: ComplexArray, K: ComplexArray) -> ComplexArray:
    """F_l(P, K) at each frequency, for P (F, outputs, inputs) and K (F, controls, measurements)."""
    controls, measurements = K.shape[-2:]
    m, p = P.shape[-2] - measurements, P.shape[-1] - controls
    P11, P12, P21, P22 = P[:, :m, :p], P[:, :m, p:], P[:, m:, :p], P[:, m:, p:]
    return P11 + P12 @ np.linalg.solve(np.eye(controls) - K @ P22, K @ P21)


def closing_error(plant: Any, P: ComplexArray, K: Any, C: ComplexArray, omega: Any) -> RealArray:
    """Bound of the effect of rounding on `lower_closed` at each frequency (F,).

    P and C are the responses of plant and controller K. Each is computed a second time, by the
    transposed system; the difference shows the effect of rounding. The loop amplifies it, and parts
    of the loop may cancel.
    """
    errors = [
        CLOSING_ROUNDING
        + ROUNDING_FACTOR * _size(found - _transposed(system, omega)) / _nonzero(_size(found))
        for system, found in ((plant, P), (K, C))
    ]
    controls, measurements = C.shape[-2:]
    m, p = P.shape[-2] - measurements, P.shape[-1] - controls
    loop = np.eye(controls) - C @ P[:, m:, p:]
    with np.errstate(all="ignore"):
        gain = _size(C) / np.linalg.svd(loop, compute_uv=False)[:, -1]
    through = _size(P[:, :m, p:]) * gain * _size(P[:, m:, :p])
    whole = _size(P[:, :m, :p]) + through * (1 + gain * _size(P[:, m:, p:]))
    return (errors[0] + errors[1]) * whole


def _transposed(system: Any, omega: RealArray) -> ComplexArray:
    """The response by the transposed system, which is rounded differently."""
    import control

    A, B, C, D = (np.asarray(getattr(system, part)).T for part in "ACBD")
    other = control.StateSpace(A, B, C, D, system.dt, remove_useless_states=False)
    return plain_response(other, omega).mT


def _size(M: ComplexArray) -> RealArray:
    """Frobenius norms (F,)."""
    return np.linalg.norm(M, axis=(-2, -1))


def _nonzero(sizes: RealArray) -> RealArray:
    """The sizes, with 1 for each 0."""
    return np.where(sizes > 0.0, sizes, 1.0)


def upper_closed(M: ComplexArray, Delta: ComplexArray) -> ComplexArray:
    """F_u(M, Delta) for M (..., outputs, inputs) and Delta (..., rows, columns)."""
    rows, columns = Delta.shape[-2:]
    M11, M12 = M[..., :columns, :rows], M[..., :columns, rows:]
    M21, M22 = M[..., columns:, :rows], M[..., columns:, rows:]
    loop = np.eye(columns) - M11 @ Delta
    return M22 + M21 @ Delta @ np.linalg.solve(loop, M12)


def tried_frequencies(
    poles: ComplexArray, omega: float = math.nan, dt: float | None = None
) -> RealArray:
    """Frequencies [rad/s] (F,) at which a claim about a loop is tried.

    They are dense around the peak at `omega` and around every lightly damped pole, and evenly
    spread elsewhere; 0 and the highest frequency (infinity, or pi / dt) are among them.
    """
    top = math.inf
    if dt:
        top = math.pi / dt
        poles = np.log(poles[np.abs(poles) > 0].astype(complex)) / dt
    size = np.abs(poles)
    light: ComplexArray = poles[(poles.imag > 0) & (np.abs(poles.real) < LIGHT_DAMPING * size)]
    size = size[size > 0]
    found = [np.array([0.0, top])]
    if size.size:
        band = size.min() / 10, size.max() * 10
        found.append(np.geomspace(*band, tries(SPREAD_FREQUENCIES)))
    found += [one.imag + abs(one.real) * np.array(NEAR_A_POLE) for one in light]
    if 0.0 < omega < math.inf:
        found.append(omega * (1 + np.array(NEAR_A_PEAK)))
    every = np.unique(np.concatenate(found))
    return every[(every >= 0) & (every <= top)]


POINTS = 12
"""Number of points of the plane at which a sum is compared with its parts."""


def farthest_sum(system: Any, parts: Sequence[Any]) -> float:
    """Largest difference between a system and the sum of its parts, at points around the poles.

    It is relative to the sum of the sizes of the parts. The points lie off the axis and the unit
    circle, between sizes of the poles, where responses in doubles are good.
    """
    poles = np.linalg.eigvals(np.asarray(system.A, dtype=float)) if system.nstates else np.ones(1)
    sizes = np.maximum(np.abs(poles), 1e-9 * np.abs(poles).max() or 1.0)
    radii = np.geomspace(sizes.min() / 3.0, sizes.max() * 3.0, tries(POINTS))
    angles = np.exp(1j * (0.5 + UNIT_TURN * np.arange(len(radii))))
    worst = 0.0
    for s in radii * angles:
        values = [_at(part, s) for part in (system, *parts)]
        scale = sum(np.linalg.norm(value) for value in values)
        apart = np.linalg.norm(values[0] - sum(values[1:]))
        worst = max(worst, float(apart / scale) if scale else 0.0)
    return worst


def change_of_matrices(system: Any, other: Any) -> float:
    """Relative change of a system's matrices that is needed to get the responses of another system.

    Computed from responses at points off the axis whose sizes lie between those of the other
    system's nonzero poles: a change dA moves the response by C (s - A)^-1 dA (s - A)^-1 B. Norms
    are those of balanced states.
    """
    A, B, C, D = (np.asarray(getattr(system, part), dtype=float) for part in "ABCD")
    if not len(A):
        return 0.0
    sizes = np.abs(np.linalg.eigvals(np.asarray(other.A, dtype=float)))
    sizes = sizes[sizes > 1e-9 * sizes.max()]
    if not sizes.size:
        sizes = np.array([float(np.linalg.norm(A)) or 1.0])
    whole = np.zeros((len(A) + max(D.shape),) * 2)
    whole[: len(A), : len(A)], whole[: len(A), len(A) :][:, : D.shape[1]] = A, B
    whole[len(A) :][: D.shape[0], : len(A)] = sizes.max() * C
    units = matrix_balance(whole, permute=False, separate=True)[1][0][: len(A)]
    A, B, C = A / units[:, None] * units, B / units[:, None], C * units
    size, entering, leaving = (float(np.linalg.norm(part)) for part in (A, B, C))
    worst = 0.0
    for k, radius in enumerate(np.geomspace(sizes.min() / 2.0, sizes.max() * 2.0, tries(POINTS))):
        s = radius * np.exp(1j * (0.5 + UNIT_TURN * k))
        inner = float(np.linalg.norm(np.linalg.inv(s * np.eye(len(A)) - A)))
        scale = leaving * inner * (2.0 + size * inner) * entering + float(np.linalg.norm(D))
        apart = float(np.linalg.norm(_at(system, s) - _at(other, s)))
        worst = max(worst, apart / scale if scale else 0.0)
    return worst


UNIT_TURN = 2.399963
"""Angle [rad] from one point to the next, with which points never coincide (the golden angle)."""


def _at(system: Any, s: complex) -> ComplexArray:
    """The transfer matrix at one point."""
    A, B, C, D = (np.asarray(getattr(system, part), dtype=float) for part in "ABCD")
    if not len(A):
        return D.astype(complex)
    A, (scale, _) = matrix_balance(A, permute=False, separate=True)
    inner = np.linalg.solve(s * np.eye(len(A)) - A, (B / scale[:, None]).astype(complex))
    found: ComplexArray = D + (C * scale) @ inner
    return found


def farthest_apart(
    system: Any, other: Any, error: float, leaving: Any = None, entering: Any = None
) -> float:
    """Relative excess, over an error, of the difference of two systems on the boundary of
    stability.

    The difference is multiplied by weights of the outputs and of the inputs; None is 1.

    The points tried lie on the axis between the sizes of the first system's poles, or are spread
    over the unit circle.
    """
    if system.dt:
        points = np.exp(1j * np.linspace(0.01, 3.13, tries(POINTS)))
    else:
        poles = np.linalg.eigvals(np.asarray(system.A, dtype=float)) if system.nstates else [1.0]
        sizes = np.maximum(np.abs(poles), 1e-9 * np.abs(poles).max() or 1.0)
        points = 1j * np.geomspace(sizes.min() / UNIT_TURN, sizes.max() * 3.0, tries(POINTS))
    worst = 0.0
    for s in points:
        value, its = _at(system, s), _at(other, s)
        if leaving is not None:
            value, its = _at(leaving, s) @ value, _at(leaving, s) @ its
        if entering is not None:
            value, its = value @ _at(entering, s), its @ _at(entering, s)
        apart, scale = np.linalg.norm(value - its, 2) - error, np.linalg.norm(value, 2)
        worst = max(worst, float(apart / scale) if scale else 0.0)
    return worst
