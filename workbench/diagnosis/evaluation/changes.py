"""Change detection: levels with hysteresis for abrupt faults, CUSUM and GLR for small or slow ones.

E. S. Page, Continuous inspection schemes, Biometrika 41 (1954); D. Siegmund, Sequential Analysis
(1985); M. Basseville and I. V. Nikiforov, Detection of Abrupt Changes (1993), chapter 2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled
from workbench.errors import InputError
from workbench.input_checks import need_numbers, need_places, need_whole
from workbench.simulation import Controller

OVERSHOOT_DEVIATIONS = 1.166
"""Mean overshoot of a sum of Gaussian steps at a boundary, in standard deviations; it is twice the
0.583 of Siegmund, for the two ends of the sum's range."""


def hysteresis(on: float, off: float, *, signal: int = 0, falling: bool = False) -> Controller:
    """An alarm (0 or 1) that is raised when a signal is above `on` and ends when it is below `off`.

    With `falling` the alarm is raised when the signal is below `on` and ends when it is above
    `off`. `signal` is the number of the measurement. Raises InputError unless off <= on, or
    off >= on with `falling`.

    Examples
    --------
    >>> from workbench.diagnosis import hysteresis
    >>> from workbench.simulation import play
    >>> play(hysteresis(on=1.0, off=0.5), [[0.8], [1.2], [0.8], [0.3]]).ravel().tolist()
    [0.0, 1.0, 1.0, 0.0]
    """
    need_numbers(on=on, off=off)
    need_places(signal=signal)
    sign = -1.0 if falling else 1.0
    if not sign * off <= sign * on:
        order = "off >= on for a fall" if falling else "off <= on for a rise"
        raise InputError(f"the alarm is raised at {on} and ends at {off}: need {order}")
    return Controller(
        _hysteresis,
        np.zeros(1),
        np.array([on, off, signal, sign], float),
        outputs=1,
        reads=signal + 1,
    )


def cusum(
    drift: float, *, mean: float = 0.0, ceiling: float = math.inf, signal: int = 0
) -> Controller:
    """Page's cumulative sums for a rise and for a fall of the mean.

        g+[k] = max(0, g+[k - 1] + r[k] - mean - drift),
        g-[k] = max(0, g-[k - 1] - r[k] + mean - drift).

    The outputs are g+ and g-, which are compared with a threshold. In each sample the sums lose
    `drift`, which is usually half the smallest change of interest; a smaller drift finds slower
    faults. The sums stay below `ceiling`, so that they return to 0 within ceiling / drift samples
    after the end of a fault.

    Raises InputError unless drift >= 0 and ceiling > 0.

    Examples
    --------
    >>> from workbench.diagnosis import cusum
    >>> from workbench.simulation import play
    >>> play(cusum(drift=0.5), [[0.0], [1.0], [1.0], [0.0]])[:, 0].tolist()
    [0.0, 0.5, 1.0, 0.5]
    """
    need_numbers(drift=drift, mean=mean, ceiling=ceiling)
    need_places(signal=signal)
    if not (0.0 <= drift < math.inf and math.isfinite(mean) and ceiling > 0.0):
        raise InputError(
            f"drift {drift}, mean {mean}, ceiling {ceiling}: need drift >= 0 < ceiling"
        )
    return Controller(
        _cusum,
        np.zeros(2),
        np.array([drift, mean, ceiling, signal], float),
        outputs=2,
        reads=signal + 1,
    )


def cusum_threshold(run_length: float, drift: float, deviation: float) -> float:
    """The threshold of a sum that white Gaussian noise passes once in `run_length` samples.

    Siegmund's approximation, with b = h / sigma + 1.166 and d = drift / sigma:

        run_length = (exp(2 d b) - 2 d b - 1) / (2 d^2).

    Coloured noise passes it more often; take the threshold from records then. `deviation` is sigma,
    the standard deviation of the residual. Raises InputError unless all are positive and the run
    length is longer than that of the threshold 0.

    Examples
    --------
    >>> from workbench.diagnosis import cusum_threshold
    >>> round(cusum_threshold(run_length=465.0, drift=0.5, deviation=1.0), 1)
    4.3
    """
    need_numbers(run_length=run_length, drift=drift, deviation=deviation)
    if not (0.0 < run_length < math.inf and 0.0 < drift < math.inf and 0.0 < deviation < math.inf):
        raise InputError(
            f"run_length {run_length}, drift {drift}, deviation {deviation}: all must be positive "
            "and finite"
        )
    d = drift / deviation
    fixed = math.log(2.0) + 2.0 * math.log(d)

    def log_run_length(b: float) -> float:
        x = 2.0 * d * b
        if x > 500.0:  # beyond the range of exp
            return x - fixed
        # expm1(x) - x loses all digits for small x, where it is x^2 / 2.
        excess = math.log(math.expm1(x) - x) if x > 1e-4 else 2.0 * math.log(x) - math.log(2.0)
        return excess - fixed

    wanted = math.log(run_length)
    if log_run_length(OVERSHOOT_DEVIATIONS) > wanted:
        raise InputError(
            f"a run length of {run_length} samples is below that of a threshold of 0, "
            f"exp({log_run_length(OVERSHOOT_DEVIATIONS):.4g})"
        )
    top = OVERSHOOT_DEVIATIONS
    while log_run_length(top) < wanted:
        top *= 2.0
    b = (
        brentq(lambda b: log_run_length(b) - wanted, OVERSHOOT_DEVIATIONS, top)
        if top > OVERSHOOT_DEVIATIONS
        else top
    )
    return (float(b) - OVERSHOOT_DEVIATIONS) * deviation


def glr(window: int, deviation: float, *, mean: float = 0.0, signal: int = 0) -> Controller:
    """Generalised likelihood ratio of a change of the mean, of any size, in the last samples.

        g[k] = max over j = 1 ... window of (sum of the last j of r - mean)^2 / (2 sigma^2 j).

    The outputs are g, the j that gives it (the change is j - 1 samples old) and the estimated
    change. The noise is assumed white and Gaussian with the standard deviation sigma, `deviation`.

    Raises InputError unless window >= 1 and deviation > 0.

    Examples
    --------
    >>> from workbench.diagnosis import glr
    >>> from workbench.simulation import play
    >>> play(glr(window=2, deviation=1.0), [[0.0], [2.0], [2.0]])[:, 0].tolist()
    [0.0, 2.0, 4.0]
    """
    need_whole(window, "window")
    need_numbers(deviation=deviation, mean=mean)
    need_places(signal=signal)
    if not math.isfinite(mean):
        raise InputError(f"mean is {mean}; it must be finite")
    if window < 1 or not 0.0 < deviation < math.inf:
        raise InputError(f"window {window}, deviation {deviation}: need 1 or more, and positive")
    weights = 1.0 / (2.0 * deviation**2 * np.arange(1, window + 1))
    parameters = np.array([window, mean, signal, *weights], float)
    return Controller(_glr, np.zeros(1 + window), parameters, outputs=3, reads=signal + 1)


@compiled
def _hysteresis(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    sign = parameters[3]
    value = sign * measurement[int(parameters[2])]
    if value > sign * parameters[0]:
        state[0] = 1.0
    elif value < sign * parameters[1]:
        state[0] = 0.0
    output[0] = state[0]


@compiled
def _cusum(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    drift, ceiling = parameters[0], parameters[2]
    change = measurement[int(parameters[3])] - parameters[1]
    state[0] = min(max(0.0, state[0] + change - drift), ceiling)
    state[1] = min(max(0.0, state[1] - change - drift), ceiling)
    output[0], output[1] = state[0], state[1]


@compiled
def _glr(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """One sample. The state is the number of samples, then a ring of the last `window` changes."""
    window, seen = int(parameters[0]), int(state[0])
    place = 1 + seen % window
    state[place] = measurement[int(parameters[2])] - parameters[1]
    state[0] = seen + 1
    total, best, age, change = 0.0, -1.0, 1, 0.0
    for j in range(1, min(seen + 1, window) + 1):
        total += state[place]
        place = place - 1 if place > 1 else window
        ratio = parameters[2 + j] * total * total
        if ratio > best:
            best, age, change = ratio, j, total / j
    output[0], output[1], output[2] = best, float(age), change
