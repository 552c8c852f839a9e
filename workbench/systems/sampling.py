"""Exact discretisation of linear systems with held inputs, and simulation between samples."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.systems.conversion import as_states
from workbench.systems.joints import system_of
from workbench.systems.range_hints import warn_long_period


def held_input_matrices(a: ArrayLike, b: ArrayLike, duration: float) -> tuple[RealArray, RealArray]:
    """Transition matrix (n, n) and input matrix (n, m) of x' = a x + b u over `duration` [s].

    The input u is constant for this time.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import held_input_matrices
    >>> A, B = held_input_matrices([[-1.0]], [[1.0]], duration=0.5)
    >>> bool(np.isclose(A[0, 0], np.exp(-0.5))), bool(np.isclose(B[0, 0], 1 - np.exp(-0.5)))
    (True, True)
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    n, m = b.shape
    block = np.zeros((n + m, n + m))
    block[:n] = np.hstack([a, b])
    block = expm(block * float(duration))
    return block[:n, :n], block[:n, n:]


def split_delay(delay: float) -> tuple[int, float]:
    """Split a delay in samples into whole samples and a fraction in [0, 1).

    Raises InputError unless the delay is finite and not negative.
    """
    if not (math.isfinite(delay) and delay >= 0.0):
        raise InputError(f"delay is {delay}; it must be a finite number of samples, 0 or more")
    whole = math.floor(delay)
    return whole, delay - whole


def sampled_model(system: Any, dt: float, *, delay_samples: float = 0.0) -> StateSpace:
    """Exact discrete-time model of a system whose held inputs arrive late.

    ``dt`` [s]: the sampling time; ``delay_samples`` [samples]: how late they arrive. Within [k, k +
    1) samples the input changes once, at k plus the fraction of the delay, so the plant is
    discretised over two pieces. The delayed inputs become states, placed after those of the plant.

    Raises
    ------
    InputError
        The system is sampled already, or the object is no system; the time or the delay is wrong.

    Warns
    -----
    RangeWarning
        The sampling time is above 100 times the system's longest time constant.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.simulation import sampled_model
    >>> G = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> late = sampled_model(G, 0.1, delay_samples=0.5)
    >>> late.nstates, bool(np.isclose(late.dcgain(), 1.0))
    (2, True)
    """
    import control

    system = _states_of(system)
    if system.dt:
        raise InputError(f"the system is sampled already (dt = {system.dt}); give a continuous one")
    need_positive(dt, "dt")
    split_delay(delay_samples)
    warn_long_period(dt, system, "plant")
    parts = held_matrices((system.A, system.B, system.C, system.D), dt, delay_samples)
    return control.ss(*parts, float(dt))


def held_matrices(
    parts: tuple[RealArray, RealArray, RealArray, RealArray], period: float, delay: float
) -> tuple[RealArray, RealArray, RealArray, RealArray]:
    """A, B, C and D of `sampled_model`, from those of a system in continuous time."""
    A, B, C, D = parts
    n, m = B.shape
    whole, rest = split_delay(delay)
    through, new, old = held_pieces(A, B, period, rest)
    waiting = whole + (rest > 0.0)
    a = np.zeros((n + m * waiting, n + m * waiting))
    b = np.zeros((n + m * waiting, m))
    c = np.zeros((len(C), n + m * waiting))
    d = np.zeros((len(C), m))
    a[:n, :n] = through
    c[:, :n] = C

    def tap(age: int, states: RealArray, direct: RealArray) -> RealArray:
        """The columns of a matrix that multiply the input of `age` samples ago."""
        start = n + m * (age - 1)
        return direct if age == 0 else states[:, start : start + m]

    tap(whole, a, b)[:n] += new
    if rest > 0.0:
        tap(whole + 1, a, b)[:n] += old
    tap(waiting, c, d)[:] += D
    if waiting:
        b[n : n + m] = np.eye(m)
        a[n + m :, n:-m] = np.eye(m * (waiting - 1))
    return a, b, c, d


def held_pieces(
    A: RealArray, B: RealArray, period: float, rest: float
) -> tuple[RealArray, RealArray, RealArray]:
    """Matrices of a sampling interval during which an input changes after the part `rest` of it.

    These are the transition matrix of the states (n, n), and the contributions of the new and of
    the old input (n, m).
    """
    before, old = held_input_matrices(A, B, rest * period)
    after, new = held_input_matrices(A, B, (1.0 - rest) * period)
    return after @ before, new, after @ old


def _states_of(system: Any) -> StateSpace:
    return as_states(system_of(system, "system"), "system")


def respond(system: Any, inputs: ArrayLike) -> RealArray:
    """Outputs (N, outputs) of a discrete-time system, initially at rest, for inputs (N, inputs).

    Raises InputError for another shape, and for a continuous system.

    Examples
    --------
    >>> import control
    >>> from workbench.simulation import respond
    >>> delay = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], 1.0)
    >>> respond(delay, [[1.0], [2.0], [3.0]]).ravel().tolist()
    [0.0, 1.0, 2.0]
    """
    system = _states_of(system)
    if system.isctime(strict=True):
        raise InputError("the system is continuous; `sampled_model` is how to sample it")
    u = np.ascontiguousarray(inputs, float)
    if u.ndim != 2 or u.shape[1] != system.ninputs:
        raise InputError(f"inputs have shape {u.shape}; they must be (N, {system.ninputs})")
    matrices = (np.ascontiguousarray(m) for m in (system.A, system.B, system.C, system.D))
    return _respond(*matrices, u)


@compiled
def _respond(a: RealArray, b: RealArray, c: RealArray, d: RealArray, u: RealArray) -> RealArray:
    """Outputs (N, p) of x+ = a x + b u, y = c x + d u from x = 0."""
    n, m, p = len(a), b.shape[1], len(c)
    x, after, y = np.zeros(n), np.zeros(n), np.zeros((len(u), p))
    for k in range(len(u)):
        for i in range(p):
            total = 0.0
            for j in range(n):
                total += c[i, j] * x[j]
            for j in range(m):
                total += d[i, j] * u[k, j]
            y[k, i] = total
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += a[i, j] * x[j]
            for j in range(m):
                total += b[i, j] * u[k, j]
            after[i] = total
        x[:] = after
    return y


def lowpass_weights(corner: float, duration: float) -> RealArray:
    """Weights (4,) that advance a first-order low-pass by one step of a parabolic input.

    y(h) = w0 y(0) + w1 q(0) + w2 q(h/2) + w3 q(h) is exact for y' = corner (q - y) when q is the
    parabola through its values at the start, the middle and the end of the step. `corner` is the
    corner frequency [rad/s] and `duration` the step h [s].
    """
    ah = corner * duration
    chain = np.zeros((4, 4))  # y, q, q', q'' in units of the step
    chain[0, :2] = -ah, ah
    chain[1, 2] = chain[2, 3] = 1.0
    grown = expm(chain)[0]
    derivatives = np.array([[1.0, 0.0, 0.0], [-3.0, 4.0, -1.0], [4.0, -8.0, 4.0]])
    return np.concatenate([grown[:1], grown[1:] @ derivatives])
