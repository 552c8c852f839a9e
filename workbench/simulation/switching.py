"""Small parts of strategies: what a controller is given while a measurement is not to be trusted.

w is the quality of the measurement, 1: good, 0: worthless. A quality outside 0 to 1 makes outputs
NaN, which every run reports.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.arrays import RealArray
from workbench.compiled import kernel
from workbench.errors import InputError
from workbench.heavy_types import StateSpace, TransferFunction
from workbench.simulation.controllers import Controller, in_discrete_time


def blend() -> Controller:
    """w a + (1 - w) b of the given (w, a, b); b = 0 where it is not given."""
    return Controller(_blend, np.zeros(0), np.zeros(0))


def removed(gain: float = 1.0) -> Controller:
    """a - (1 - w) gain f of the given (w, a, f): an estimated fault f taken out of a."""
    return Controller(_removed, np.zeros(0), np.array([gain], float))


def total() -> Controller:
    """The sum of what is given."""
    return Controller(_total, np.zeros(0), np.zeros(0))


def silenced(intervals: Sequence[tuple[float, float]], period: float) -> Controller:
    """The given w, and 0 in intervals of time [s], from and until: a detector's false alarms.

    Time runs from the first sample of its first stage. Raises InputError for intervals that are
    empty, out of order or overlap.
    """
    times = np.array(intervals, float).reshape(-1, 2)
    if not (np.isfinite(times).all() and (np.diff(times.ravel()) > 0.0).all()):
        raise InputError(f"intervals are {intervals}; need from < until, one after the other")
    # The half sample makes rounding no matter.
    return Controller(_silenced, np.zeros(1), times.ravel() / period - 0.5, period=period)


def following(
    system: StateSpace | TransferFunction,
    period: float,
    rate: float = 500.0,
    substitute: bool = False,
) -> Controller:
    """A linear controller that follows who is in charge while it is not: bumpless transfer.

    It is given (e, w, v): its input, its share of the command, for a substitute that of the one
    that it replaces, and the command of the sample before. While its share q is below 1 an observer
    makes its state one that would have given v:

        x := A x + B e + (1 - q) L (v - y),    A - L C settles at `rate` [1/s].

    A rate near the loop's bandwidth is too much: where the command is shared, each follows the
    other. Poles that are faster stay.

    Raises InputError for more than one input or output, a rate that is not positive, and when a
    pole that is slower does not show in the output.
    """
    from scipy.signal import place_poles

    discrete = in_discrete_time(system, period)
    n = discrete.nstates
    if (discrete.ninputs, discrete.noutputs) != (1, 1):
        raise InputError(
            f"{discrete.ninputs} inputs and {discrete.noutputs} outputs; only one of each can "
            "follow"
        )
    if not 0.0 < rate < np.inf:
        raise InputError(f"rate is {rate} 1/s; it must be positive and finite")
    poles = discrete.poles()
    slow = np.flatnonzero(abs(poles) > np.exp(-rate * period))
    wanted = poles.copy()
    wanted[slow] = np.exp(-rate * period * (1.0 + 0.1 * np.arange(len(slow))))
    L = np.zeros(n)
    if slow.size:
        try:
            L = place_poles(discrete.A.T, discrete.C.T, wanted).gain_matrix[0]
        except ValueError as fault:
            raise InputError(f"no observer of the controller's states: {fault}") from fault
    matrices = (discrete.A, discrete.B, discrete.C, discrete.D, L)
    parameters = np.concatenate([[n, substitute], *(np.ravel(one) for one in matrices)])
    state = np.zeros(2 * n + 2)
    state[-1] = 1.0
    return Controller(_following, state, parameters, period=period, carried=n)


@kernel
def _blend(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    w, b = given[0], given[2] if len(given) > 2 else 0.0
    # Not w a + (1 - w) b: what is not wanted at all may be huge.
    told[0] = given[1] if w == 1.0 else b if w == 0.0 else w * given[1] + (1.0 - w) * b
    if not 0.0 <= w <= 1.0:
        told[0] = np.nan


@kernel
def _removed(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    w = given[0]
    told[0] = given[1] - (1.0 - w) * parameters[0] * given[2] if 0.0 <= w <= 1.0 else np.nan


@kernel
def _total(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    told[0] = 0.0
    for i in range(len(given)):
        told[0] += given[i]


@kernel
def _silenced(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    told[0] = given[0]
    for i in range(0, len(parameters), 2):
        if parameters[i] <= state[0] < parameters[i + 1]:
            told[0] = 0.0
    state[0] += 1.0


@kernel
def _following(state: RealArray, p: RealArray, given: RealArray, told: RealArray) -> None:
    """State: x, room for the next x, own output and share of the sample before."""
    n = int(p[0])
    at_b, at_c = 2 + n * n, 2 + n * n + n
    at_d, at_l = at_c + n, at_c + n + 1
    e, w = given[0], given[1] if p[1] == 0.0 else 1.0 - given[1]
    missing = (1.0 - state[2 * n + 1]) * (given[2] - state[2 * n])
    y = p[at_d] * e
    for i in range(n):
        state[i] += p[at_l + i] * missing
        y += p[at_c + i] * state[i]
    for i in range(n):
        state[n + i] = p[at_b + i] * e
        for j in range(n):
            state[n + i] += p[2 + i * n + j] * state[j]
    for i in range(n):
        state[i] = state[n + i]
    state[2 * n], state[2 * n + 1] = y, w
    told[0] = y if 0.0 <= w <= 1.0 else np.nan
