"""Thresholds of residuals: from fault-free records, from bounds on disturbances, and adaptive.

M. Basseville and I. V. Nikiforov, Detection of Abrupt Changes (1993); J. Chen and R. J. Patton,
Robust Model-Based Fault Diagnosis for Dynamic Systems (1999), chapter 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from workbench._core.arrays import RealArray
from workbench._core.compiled import compiled
from workbench.diagnosis.evaluation.residual_size import as_series
from workbench.errors import InputError
from workbench.input_checks import need_numbers, need_places, need_whole
from workbench.simulation import Controller


@dataclass(frozen=True)
class Threshold:
    """A level, and the share of fault-free values above it.

    level       the threshold;
    rate        the expected share of fault-free values above the level;
    interval    contains that share with the probability `confidence`;
    samples     the number of fault-free values (or blocks of them) that the level was taken from.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import quantile_threshold
    >>> found = quantile_threshold(np.arange(1000.0), false_alarm_rate=0.05)
    >>> found.samples, found.confidence, bool(found.interval[0] < found.rate < found.interval[1])
    (1000, 0.95, True)
    """

    level: float
    rate: float
    interval: tuple[float, float]
    confidence: float
    samples: int


def quantile_threshold(
    clean: ArrayLike, false_alarm_rate: float, *, confidence: float = 0.95, block: int = 1
) -> Threshold:
    """The least fault-free value (N,) that new values exceed at most at the given rate.

    The share of new values above the k-th smallest of n is distributed as Beta(n + 1 - k, k),
    whatever their own (continuous) distribution, if the values are independent. Neighbouring
    samples seldom are. With `block` above 1 the largest value of each block of samples is taken,
    and the rate is that of blocks; they must be longer than the residual's memory.

    Raises InputError if there are too few values for the rate, or they are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.diagnosis import quantile_threshold
    >>> found = quantile_threshold(np.arange(1000.0), false_alarm_rate=0.05)
    >>> found.level, round(found.rate, 3)
    (950.0, 0.05)
    """
    values = as_series("clean", clean)
    need_numbers(false_alarm_rate=false_alarm_rate, confidence=confidence)
    need_whole(block, "block")
    if not (0.0 < false_alarm_rate < 1.0 and 0.0 < confidence < 1.0 and block >= 1):
        raise InputError(
            f"false_alarm_rate {false_alarm_rate}, confidence {confidence}, block {block}: "
            "need rates between 0 and 1 and a block of 1 or more"
        )
    n = len(values) // block
    # Without the 1e-9, rounding would require one value more, for instance 100 instead of 99 at a
    # rate of 1/100.
    k = math.ceil((n + 1) * (1.0 - false_alarm_rate) - 1e-9)
    if n < 1 or k > n:
        raise InputError(
            f"{n} fault-free values ({len(values)} samples in blocks of {block}) for a false-alarm "
            f"rate of {false_alarm_rate}: at least {math.ceil(1.0 / false_alarm_rate) - 1} needed"
        )
    ordered = np.sort(values[: n * block].reshape(n, block).max(axis=1))
    share = stats.beta(n + 1 - k, k)
    low, high = share.interval(confidence)
    return Threshold(float(ordered[k - 1]), float(share.mean()), (low, high), confidence, n)


def bounded_threshold(gains: ArrayLike, bounds: ArrayLike, *, noise: float = 0.0) -> float:
    """The level that no fault-free residual exceeds: the sum of gain times bound.

    gains   (M,), from each disturbance to the residual, the largest over the whole uncertainty set;
            H-infinity norms for signals measured by their 2-norm, 1-norms of the impulse responses
            for signals measured by their peak;
    bounds  (M,), of the disturbances, in the norm that belongs to the gains;
    noise   rms of the noise in the residual, if it is not among the disturbances.

    Raises InputError for different lengths, negative values, and a level that is not above the
    noise.

    Examples
    --------
    >>> from workbench.diagnosis import bounded_threshold
    >>> float(bounded_threshold(gains=[2.0, 0.5], bounds=[0.1, 0.4]))
    0.40000000000000036
    """
    gain, bound = as_series("gains", gains), as_series("bounds", bounds)
    if gain.shape != bound.shape or min(gain.min(), bound.min()) < 0.0:
        raise InputError(f"gains {gain}, bounds {bound}: need equally many, none negative")
    # Each product and each sum rounds by half a unit at most; none of them may round down.
    level = math.fsum(gain * bound) * (1.0 + 4.0 * np.finfo(float).eps)
    return above_noise(level, noise)


def above_noise(level: float, noise: float) -> float:
    """The given level. Raises InputError unless it is finite and above the noise.

    Examples
    --------
    >>> from workbench.diagnosis.evaluation.thresholds import above_noise
    >>> above_noise(0.5, noise=0.1)
    0.5
    """
    need_numbers(level=level, noise=noise)
    if not (math.isfinite(level) and 0.0 <= noise < math.inf):
        raise InputError(f"level {level}, noise {noise}: both must be finite, noise not negative")
    if level <= noise:
        raise InputError(
            f"the threshold {level:.4g} is not above the noise of {noise:.4g} rms: "
            "fault-free records would raise alarms; raise the threshold or filter the residual"
        )
    return level


def adaptive_alarm(
    base: float, gain: float, decay: float, *, residual: int = 0, known: int = 1
) -> Controller:
    """An alarm while |r| > T, where the threshold T follows a known signal v.

        T[k] = base + gain m[k],    m[k] = decay m[k - 1] + |v[k]|.

    The signal v is an input, or the level of a disturbance. Suppose the model error lets v into the
    residual by an impulse response with |h[i]| <= gain decay^i, and everything else adds no more
    than `base`: then no fault-free residual is ever above T. The outputs are the alarm (0 or 1) and
    T. `residual` and `known` are the numbers of the measurements r and v.

    Raises InputError unless base > 0, gain >= 0 and 0 <= decay < 1.

    Examples
    --------
    >>> from workbench.diagnosis import adaptive_alarm
    >>> from workbench.simulation import play
    >>> alarm = adaptive_alarm(base=0.1, gain=1.0, decay=0.5)
    >>> play(alarm, [[0.5, 0.0], [0.5, 1.0], [0.5, 0.0]]).tolist()  # rows: alarm and threshold
    [[1.0, 0.1], [0.0, 1.1], [0.0, 0.6]]
    """
    need_numbers(base=base, gain=gain, decay=decay)
    need_places(residual=residual, known=known)
    if not (0.0 < base < math.inf and 0.0 <= gain < math.inf and 0.0 <= decay < 1.0):
        raise InputError(
            f"base {base}, gain {gain}, decay {decay}: need base > 0, gain >= 0, 0 <= decay < 1"
        )
    parameters = np.array([base, gain, decay, residual, known], float)
    return Controller(_adaptive, np.zeros(1), parameters, outputs=2, reads=max(residual, known) + 1)


@compiled
def _adaptive(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    base, gain, decay = parameters[0], parameters[1], parameters[2]
    state[0] = decay * state[0] + abs(measurement[int(parameters[4])])
    output[1] = base + gain * state[0]
    output[0] = 1.0 if abs(measurement[int(parameters[3])]) > output[1] else 0.0
