"""Small parts of strategies, which replace the input of a controller at unreliable measurements.

w is the quality of the measurement, from 1 (good) to 0 (worthless). A quality outside 0 to 1 makes
the outputs NaN, which every run reports.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench._core.heavy_types import StateSpace, TransferFunction
from workbench.errors import InputError
from workbench.simulation.controllers import Controller, discrete_system


def blender() -> Controller:
    """Part that reads (w, a, b) and gives w a + (1 - w) b; b is 0 if it is not given.

    Examples
    --------
    >>> from workbench.simulation import blender, play
    >>> play(blender(), [[1.0, 5.0, 7.0], [0.25, 8.0, 4.0]]).ravel().tolist()
    [5.0, 5.0]
    """
    return Controller(_blend, np.zeros(0), np.zeros(0))


def fault_subtractor(*, gain: float = 1.0) -> Controller:
    """Part that reads (w, a, f) and gives a - (1 - w) gain f: it subtracts an estimated fault f.

    Examples
    --------
    >>> from workbench.simulation import play, fault_subtractor
    >>> play(fault_subtractor(), [[1.0, 5.0, 2.0], [0.0, 5.0, 2.0]]).ravel().tolist()
    [5.0, 3.0]
    """
    return Controller(_removed, np.zeros(0), np.array([gain], float))


def adder() -> Controller:
    """Part that gives the sum of its inputs.

    Examples
    --------
    >>> from workbench.simulation import play, adder
    >>> play(adder(), [[1.0, 2.0, 3.0]]).ravel().tolist()
    [6.0]
    """
    return Controller(_total, np.zeros(0), np.zeros(0))


def interval_gate(intervals: Sequence[tuple[float, float]], dt: float) -> Controller:
    """Part that reads w and gives w, but 0 in intervals (from, until) [s]: false alarms.

    Time starts when the part is first in charge. `dt` is the sampling period [s]. Raises
    InputError for intervals that are empty, out of order or overlapping.

    Examples
    --------
    >>> from workbench.simulation import play, interval_gate
    >>> play(interval_gate([(1.0, 3.0)], dt=1.0), [[1.0]] * 4).ravel().tolist()
    [1.0, 0.0, 0.0, 1.0]
    """
    times = np.array(intervals, float).reshape(-1, 2)
    if not (np.isfinite(times).all() and (np.diff(times.ravel()) > 0.0).all()):
        raise InputError(f"intervals are {intervals}; need from < until, one after the other")
    # Half a sample of offset makes the comparison insensitive to rounding.
    return Controller(_silenced, np.zeros(1), times.ravel() / dt - 0.5, dt=dt)


def ramped_gain(rate: float, start: float, dt: float) -> Controller:
    """Part that reads a and gives a with a gain of 1 that changes by `rate` [dB/s] from `start` on.

    Time [s] starts when the part is first in charge. `dt` is the sampling period [s]. Raises
    InputError for a rate that is not finite and for a start that is negative or not finite.

    Examples
    --------
    >>> from workbench.simulation import play, ramped_gain
    >>> louder = play(ramped_gain(rate=20.0, start=0.0, dt=1.0), [[1.0]] * 3)
    >>> louder.ravel().round(6).tolist()  # 20 dB in a second
    [1.0, 10.0, 100.0]
    """
    if not (np.isfinite(rate) and 0.0 <= start < np.inf):
        raise InputError(f"rate is {rate} dB/s, start is {start} s; need finite, start 0 or later")
    grown = 10.0 ** (rate * dt / 20.0)
    return Controller(_ramped, np.zeros(1), np.array([grown, start / dt]), dt=dt)


def tracking_controller(
    system: StateSpace | TransferFunction,
    dt: float,
    rate: float,
    *,
    substitute: bool = False,
) -> Controller:
    """Linear controller that tracks the command while it is not in charge: bumpless transfer.

    It reads (e, w, v): its input e, its share w of the command, and the command v of the previous
    sample. For a `substitute` w is the share of the controller that it replaces, so its own share
    is q = 1 - w; otherwise q = w. While q was below 1 at the previous sample, an observer moves its
    state towards one that would have given v:

        x := A x + B e + (1 - q) L (v - y),    where A - L C settles at `rate` [1/s].

    A rate near the bandwidth of the loop is too high, because two controllers that share the
    command would then follow each other. Poles faster than the rate are kept.

    Raises InputError for more than one input or output, for a rate that is not positive, and if a
    slower pole is unobservable at the output.

    Examples
    --------
    >>> import control
    >>> from workbench.simulation import tracking_controller, play
    >>> K = tracking_controller(control.tf([1.0, 5.0], [1.0, 0.1]), dt=1e-3, rate=100.0)
    >>> play(K, [[1.0, 1.0, 0.0]] * 3).shape
    (3, 1)
    """
    from scipy.signal import place_poles

    discrete = discrete_system(system, dt)
    n = discrete.nstates
    if (discrete.ninputs, discrete.noutputs) != (1, 1):
        raise InputError(
            f"{discrete.ninputs} inputs and {discrete.noutputs} outputs; only one of each can "
            "follow"
        )
    if not 0.0 < rate < np.inf:
        raise InputError(f"rate is {rate} 1/s; it must be positive and finite")
    poles = discrete.poles()
    slow = np.flatnonzero(abs(poles) > np.exp(-rate * dt))
    wanted = poles.copy()
    wanted[slow] = np.exp(-rate * dt * (1.0 + 0.1 * np.arange(len(slow))))
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
    return Controller(_following, state, parameters, dt=dt, carried_states=n)


@kernel
def _blend(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `blender`."""
    w, b = given[0], given[2] if len(given) > 2 else 0.0
    # At w = 0 and w = 1 the other input is left out, because it may be infinite there.
    told[0] = given[1] if w == 1.0 else b if w == 0.0 else w * given[1] + (1.0 - w) * b
    if not 0.0 <= w <= 1.0:
        told[0] = np.nan


@kernel
def _removed(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `fault_subtractor`."""
    w = given[0]
    told[0] = given[1] - (1.0 - w) * parameters[0] * given[2] if 0.0 <= w <= 1.0 else np.nan


@kernel
def _total(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `adder`."""
    told[0] = 0.0
    for i in range(len(given)):
        told[0] += given[i]


@kernel
def _silenced(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `interval_gate`; the state counts samples; parameters: the intervals in samples."""
    told[0] = given[0]
    for i in range(0, len(parameters), 2):
        if parameters[i] <= state[0] < parameters[i + 1]:
            told[0] = 0.0
    state[0] += 1.0


@kernel
def _ramped(state: RealArray, parameters: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `ramped_gain`; the state counts samples; parameters: growth and start in samples."""
    told[0] = given[0] * parameters[0] ** max(state[0] - parameters[1], 0.0)
    state[0] += 1.0


@kernel
def _following(state: RealArray, p: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `tracking_controller`.

    The state is x, work space for the next x, and output and share of the previous sample.
    """
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
