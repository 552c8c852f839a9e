"""Automatic gain control by a wobble: a sine in the loop tells its gain at one frequency.

The wobble w is added to the measured error e, and a gain g multiplies both before they reach the
controller K of a plant P, with L = g K P:

    v = e + w,    e = -L v (the wobble's part),    so |L| = |e| / |v| at the wobble's frequency.

Both amplitudes are found by synchronous detection, and g is moved until they are equal: the loop
then has its crossover at that frequency. The method is that of Bierhoff (1984).
"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench.errors import InputError
from workbench.simulation.controllers import Controller

STATES = 6
"""Number of states: the samples so far, real and imaginary part of the detected amplitudes of e and
v, and ln g.
"""


def automatic_gain_control(
    frequency_hz: float,
    amplitude: float,
    dt: float,
    *,
    interval: tuple[float, float] = (0.0, math.inf),
    detection: float,
    adaptation: float,
    most: float = 4.0,
) -> Controller:
    """Part that reads an error e and gives g (e + w) and the gain g, which starts at 1.

    Parameters
    ----------
    frequency_hz
        Frequency of the wobble w [Hz].
    amplitude
        Amplitude of the wobble w, in the unit of the error.
    dt
        Sampling period [s].
    interval
        Times [s] at which the wobble begins and ends. Outside this interval g is kept.
    detection
        Time constant [s] of the filters behind the detectors; the gain moves only after three of
        them.
    adaptation
        Time constant [s] with which the logarithm of the gain settles; longer than `detection`.
    most
        Largest g, and the reciprocal of the smallest.

    Raises InputError for a frequency that is not between 0 and half the sampling frequency, for
    an amplitude or a largest gain that is not positive or not above 1, for an empty interval, and
    unless 0 < detection < adaptation.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import play, automatic_gain_control
    >>> part = automatic_gain_control(50.0, 0.1, 1e-3, detection=0.1, adaptation=1.0)
    >>> play(part, np.zeros((3, 1)))[:, 1].tolist()  # the gain before its filters have settled
    [1.0, 1.0, 1.0]
    """
    if not 0.0 < frequency_hz * dt < 0.5:
        raise InputError(f"frequency_hz is {frequency_hz} Hz; need 0 to {0.5 / dt:.6g} Hz")
    if not (0.0 < amplitude < math.inf and 1.0 < most < math.inf):
        raise InputError(f"amplitude is {amplitude}, most is {most}; need above 0, above 1, finite")
    if not 0.0 <= interval[0] < interval[1]:
        raise InputError(f"interval is {interval} s; need 0 or later, and an end after that")
    if not 0.0 < detection < adaptation < math.inf:
        raise InputError(
            f"detection {detection} s, adaptation {adaptation} s; need 0 < detection < adaptation"
        )
    parameters = [
        2 * math.pi * frequency_hz * dt,
        amplitude,
        interval[0] / dt - 0.5,  # half a sample makes comparisons insensitive to rounding
        interval[1] / dt - 0.5,
        (interval[0] + 3.0 * detection) / dt - 0.5,
        -math.expm1(-dt / detection),
        dt / adaptation,
        math.log(most),
    ]
    return Controller(
        _wobbled_gain, np.zeros(STATES), np.array(parameters), outputs=2, reads=1, dt=dt
    )


@kernel
def _wobbled_gain(state: RealArray, p: RealArray, given: RealArray, told: RealArray) -> None:
    """Step of `automatic_gain_control`; the states are those of `STATES`."""
    error, wobble, now = given[0], 0.0, state[0]
    if p[2] <= now < p[3]:
        turned = p[0] * now
        cosine, sine = math.cos(turned), math.sin(turned)
        wobble = p[1] * sine
        for i, signal in enumerate((error, error + wobble)):
            state[1 + 2 * i] += p[5] * (signal * cosine - state[1 + 2 * i])
            state[2 + 2 * i] += p[5] * (signal * sine - state[2 + 2 * i])
        before = state[1] ** 2 + state[2] ** 2
        behind = state[3] ** 2 + state[4] ** 2
        if now >= p[4] and before > 0.0 and behind > 0.0:
            moved = state[5] - 0.5 * p[6] * math.log(before / behind)
            state[5] = min(max(moved, -p[7]), p[7])
    gain = math.exp(state[5])
    told[0], told[1] = gain * (error + wobble), gain
    state[0] = now + 1.0
