"""Bounds on the effect of rounding in a controller's arithmetic on its loop, for every signal.

A computed controller is x+ = A x + B y + E e, u = C x + D y + F e, where every component of e is
the rounding error of one sum. In the loop all signals are bounded by absolute sums of impulse
responses. Errors in floating point grow with the signals, and signals grow with the errors. If this
loop of bounds is a contraction, rounding cannot keep up an oscillation (a limit cycle).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag, solve_discrete_lyapunov

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.synthesis.implementation.fixed_point import FixedPoint
from workbench.systems.interconnection import NamedRealisation, connected, named_realisation

SUMMED_SAMPLES, SAMPLES_AT_ONCE = 65_536, 256
"""Largest number of samples that are added one by one, and number of samples in memory together."""
REST_SHARE = 1e-3
"""Summation ends when the bound on the later samples is below this share of the sum so far."""
FLOAT_UNITS = {"double": 2.0**-53, "float": 2.0**-24}
"""Unit roundoff of the C types."""


@dataclass(frozen=True, eq=False)
class Rounding:
    """Bounds of the rounding errors in the loop.

    ``share`` bounds the error of the control, relative to the largest control that a measurement
    error of 1 causes (floating point), or relative to its full scale (fixed point). ``contraction``
    is the gain of the loop of errors. It is 0 for fixed point, whose errors do not grow with the
    signals.
    """

    share: float
    contraction: float


@dataclass(frozen=True, eq=False)
class ComputedForm:
    """A controller (A, B, C, D) with the matrices E and F by which rounding errors enter.

    Unlike a `StateSpace`, it has inputs for rounding errors.
    """

    A: RealArray
    B: RealArray
    C: RealArray
    D: RealArray
    E: RealArray
    F: RealArray


def floating_rounding(K: StateSpace, plant: StateSpace, sign: int, unit: float) -> Rounding:
    """Bounds for a state space in floating point, in the loop y = G u + w with |w| <= 1.

    Parameters
    ----------
    K
        Sampled controller, computed row by row from its nonzero coefficients.
    plant
        Sampled plant with its delay.
    sign
        u = sign K y.
    unit
        Unit roundoff.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (K.A, K.B, K.C, K.D))
    n, p, m = len(A), len(D), D.shape[1]
    E = np.hstack([np.eye(n), np.zeros((n, p))])
    F = np.hstack([np.zeros((p, n)), np.eye(p)])
    gains = _loop_gains(ComputedForm(A, B, C, D, E, F), plant, sign)
    rows = np.abs(np.block([[A, B], [C, D]]))
    terms = np.count_nonzero(rows, axis=1) + 1.0
    growth = (terms * unit / (1 - terms * unit))[:, None] * rows
    # Columns of `gains` are measurement errors, then rounding errors; rows are x, y and then u.
    signals, from_errors = gains[: n + m, :m].sum(axis=1), gains[: n + m, m:]
    loop = growth @ from_errors
    if not np.isfinite(loop).all():
        return Rounding(math.inf, math.inf)
    contraction = float(np.abs(np.linalg.eigvals(loop)).max(initial=0.0)) if n + p else 0.0
    if not contraction < 1.0:
        return Rounding(math.inf, contraction)
    errors = np.linalg.solve(np.eye(n + p) - loop, growth @ signals)
    control = gains[n + m :, :m].sum(axis=1)
    off = gains[n + m :, m:] @ errors
    share = np.divide(off, control, out=np.zeros(p), where=control > 0)
    return Rounding(float(share.max(initial=0.0)), contraction)


def fixed_rounding(fixed: FixedPoint, plant: StateSpace, sign: int, signal_bits: int) -> Rounding:
    """Bounds for cascades in fixed point, relative to the full scale of the control.

    The plant has signals relative to full scale. Errors come from every section, and from the
    conversion of measurements and controls.
    """
    step = 2.0 ** (1 - signal_bits)
    parts, sizes = [], []
    for line, cascades in zip(fixed.quantised.channels, fixed.cascades, strict=True):
        for rows, cascade in zip(line, cascades, strict=True):
            parts.append(_injected(rows))
            sizes.append(step / 2 * np.exp2(cascade.shifts.astype(float)))
    form = _joined_form(parts, fixed.quantised.noutputs, fixed.quantised.ninputs)
    m, p = form.D.shape[1], len(form.D)
    gains = _loop_gains(form, plant, sign)[-p:]
    errors = np.concatenate([np.full(m, step / 2), *sizes])
    own = step / 2  # error of the control's conversion, at most a step in the loop
    return Rounding(float((gains @ errors).max(initial=0.0) + own), 0.0)


def _loop_gains(form: ComputedForm, plant: StateSpace, sign: int) -> RealArray:
    """Bounds on signals (x, y, u) for errors (w, e) up to 1, by absolute sums of impulse
    responses.
    """
    n, m, p, q = len(form.A), form.B.shape[1], len(form.C), form.E.shape[1]
    M = np.block(
        [
            [form.A, form.B, form.E],
            [np.eye(n), np.zeros((n, m + q))],
            [np.zeros((m, n)), np.eye(m), np.zeros((m, q))],
            [form.C, form.D, form.F],
        ]
    )
    inputs = tuple(f"y{i}" for i in range(m)) + tuple(f"e{i}" for i in range(q))
    outputs = tuple(f"o{i}" for i in range(n + m + p))
    K = NamedRealisation(M, n, float(plant.dt), inputs, outputs)
    G = named_realisation(plant)
    links = np.zeros((p + m + q, m + n + m + p))
    links[:p, m + n + m :] = sign * np.eye(p)
    links[p : p + m, :m] = np.eye(m)
    enters = np.zeros((p + m + q, m + q))
    enters[p:] = np.eye(m + q)
    leaves = np.hstack([np.zeros((n + m + p, m)), np.eye(n + m + p)])
    M, states = connected((G, K), links, enters, leaves)
    return absolute_sums(
        M[:states, :states], M[:states, states:], M[states:, :states], M[states:, states:]
    )


def absolute_sums(A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> RealArray:
    """Upper bounds (outputs, inputs) on the absolute sums of a stable system's impulse responses.

    At most `SUMMED_SAMPLES` samples are added. The later ones are bounded by Cauchy and Schwarz:
    sum |h_k| <= sqrt(sum h_k^2 r^(-2k)) sqrt(sum r^(2k)), where r^2 is the modulus of the largest
    pole. This is exact for a single mode. The bounds are infinite for an unstable system.
    """
    total = np.abs(D).astype(float)
    n = len(A)
    if n == 0:
        return total
    largest = float(np.abs(np.linalg.eigvals(A)).max())
    if not largest < 1.0:
        return np.full(total.shape, np.inf)
    block, power = B[None], A  # A^k B for the first samples, and the power of A that follows them
    while len(block) < SAMPLES_AT_ONCE:
        block = np.concatenate([block, power @ block])
        power = power @ power
    for _ in range(SUMMED_SAMPLES // SAMPLES_AT_ONCE):
        total = total + np.abs(C @ block).sum(axis=0)
        block = power @ block
        left = _bound_on_rest(A, C, block[0], largest)
        if (left <= REST_SHARE * total).all():
            break
    bound: RealArray = total + left
    return np.where(np.isfinite(bound), bound, np.inf)


def _bound_on_rest(A: RealArray, C: RealArray, start: RealArray, largest: float) -> RealArray:
    """Bounds (outputs, inputs) on the absolute sums of C A^k x for states x (n, inputs)."""
    radius = math.sqrt(largest)
    if radius == 0.0 or not np.abs(start).max() > np.finfo(float).tiny:
        return np.zeros((len(C), start.shape[1]))
    found = np.empty((len(C), start.shape[1]))
    for i, row in enumerate(C):
        Q = _gramian(A.tobytes(), len(A), radius, row.tobytes())
        energy = np.einsum("nj,nm,mj->j", start, Q, start)
        found[i] = np.sqrt(np.maximum(energy, 0.0) / (1.0 - radius**2))
    return found


@lru_cache(maxsize=256)
def _gramian(A: bytes, n: int, radius: float, row: bytes) -> RealArray:
    """The Gramian of C A^k / radius^k for one output."""
    scaled = np.frombuffer(A).reshape(n, n) / radius
    C = np.frombuffer(row)[None]
    found: RealArray = solve_discrete_lyapunov(scaled.T, C.T @ C, method="bilinear")
    return found


def _injected(rows: RealArray) -> ComputedForm:
    """One cascade of sections, with the rounding error of each section's sum as an input."""
    count = len(rows)
    A, B = np.zeros((2 * count, 2 * count)), np.zeros((2 * count, 1))
    E = np.zeros((2 * count, count))
    # Output of the sections so far, as a row of coefficients of (states, input, errors).
    state, entry, error = np.zeros(2 * count), 1.0, np.zeros(count)
    for k, (b0, b1, b2, _, a1, a2) in enumerate(rows):
        own = 2 * k
        out_state, out_entry, out_error = b0 * state, b0 * entry, b0 * error
        out_state = out_state.copy()
        out_state[own] += 1.0
        out_error = out_error.copy()
        out_error[k] += 1.0
        A[own] = b1 * state - a1 * out_state
        A[own, own + 1] += 1.0
        A[own + 1] = b2 * state - a2 * out_state
        B[own, 0], B[own + 1, 0] = b1 * entry - a1 * out_entry, b2 * entry - a2 * out_entry
        E[own], E[own + 1] = b1 * error - a1 * out_error, b2 * error - a2 * out_error
        state, entry, error = out_state, out_entry, out_error
    return ComputedForm(A, B, state[None], np.array([[entry]]), E, error[None])


def _joined_form(parts: list[ComputedForm], outputs: int, inputs: int) -> ComputedForm:
    """Cascades of all channels as one form; each output is the sum over inputs."""
    A, E = (block_diag(*(getattr(part, name) for part in parts)) for name in "AE")
    n, q = len(A), E.shape[1]
    B, D = np.zeros((n, inputs)), np.zeros((outputs, inputs))
    C, F = np.zeros((outputs, n)), np.zeros((outputs, q))
    place = error = 0
    for number, part in enumerate(parts):
        i, j = divmod(number, inputs)
        own = slice(place, place + len(part.A))
        errors = slice(error, error + part.E.shape[1])
        B[own, j], C[i, own], F[i, errors] = part.B[:, 0], part.C[0], part.F[0]
        D[i, j] += part.D[0, 0]
        place, error = own.stop, errors.stop
    return ComputedForm(A, B, C, D, E, F)
