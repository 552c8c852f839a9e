"""Credibility of two signals with a constant sum: a quality from 0 to 1, and a binary alarm.

Two sensors share a quantity, as two photo diodes share the light of a beam or two flow meters that
of a branching pipe: whatever the measured value is, a + b = level. In the plane of a / level and b
/ level all fault-free points lie on a line; the distance from it says how little the measurement (a
- b) / (a + b) can be believed (E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003), eq. 7.13 and 7.14).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench.diagnosis.evaluation.changes import hysteresis
from workbench.diagnosis.evaluation.thresholds import above_noise
from workbench.errors import InputError
from workbench.input_checks import as_array, need_numbers, need_places
from workbench.simulation import Controller

QUALITY_OUTPUTS = ("quality", "dist", "ratio")
"""Outputs of the controller that `quality_signal` returns."""
FARTHEST = 1.0 / math.sqrt(2.0)
"""Distance of a = b = 0, no signal at all, from the line a + b = level; relative to the level."""
EXTINCT = 0.02
"""Default fraction of the level; if a + b is below it, (a - b) / (a + b) would divide noise by
noise.
"""


def clean_level(record: ArrayLike) -> float:
    """Level of a signal that faults disturb for less than half of the time: the median.

    record (N,). Raises InputError for a record that is empty or not finite, and for a median that
    is not positive.

    Examples
    --------
    >>> from workbench.diagnosis import clean_level
    >>> clean_level([1.0, 1.0, 0.2, 1.0, 1.0])
    1.0
    """
    values = as_array(record, "the record")
    if values.ndim != 1 or not values.size or not np.isfinite(values).all():
        raise InputError(f"the record has shape {values.shape}; it must be (N,), finite, not empty")
    level = float(np.median(values))
    if level <= 0.0:
        raise InputError(f"the record's median is {level:.4g}; a clean level is positive")
    return level


def quality_signal(
    level: float,
    dist_min: float,
    dist_max: float,
    *,
    alpha: float = 1.0,
    noise: float | None = None,
    signals: tuple[int, int] = (0, 1),
    extinct: float = EXTINCT,
) -> Controller:
    """Controller that gives the quality of two signals, their distance and their ratio.

        dist    = |1 - (a + b) / level| / sqrt(2),
        quality = 1 up to dist_min, 0 from dist_max on, between them
                  ((dist_max - dist) / (dist_max - dist_min))^alpha,
        ratio   = (a - b) / (a + b).

    While a + b is below the share `extinct` of the level, the ratio keeps its last value and the
    quality is 0, however large dist_max.

    Parameters
    ----------
    level
        Sum of both signals while there is no fault, in their unit; see `clean_level`.
    dist_min, dist_max
        Distances, relative to the level: full credibility below the first, none from the second on.
    alpha
        Exponent of the decrease from 1 to 0 between the two distances.
    noise
        Rms of the distance without fault; if it is given, dist_min must be above it.
    signals
        Numbers of a and b among the measurements.
    extinct
        Share of the level below which the ratio is not computed.

    Raises
    ------
    InputError
        Unless 0 <= dist_min < dist_max, alpha > 0, level > 0 and 0 <= extinct < 1, all finite, and
        when dist_min is not above the noise.

    Examples
    --------
    >>> from workbench.diagnosis import quality_signal
    >>> from workbench.simulation import play
    >>> quality = quality_signal(level=2.0, dist_min=0.1, dist_max=0.5)
    >>> play(quality, [[1.0, 1.0], [0.1, 0.1]])[:, 0].tolist()
    [1.0, 0.0]
    """
    _check_level(level)
    need_numbers(dist_min=dist_min, dist_max=dist_max, alpha=alpha, extinct=extinct)
    a, b = signals
    need_places(a=a, b=b)
    if not 0.0 <= dist_min < dist_max < math.inf:
        raise InputError(f"dist_min {dist_min}, dist_max {dist_max}: need 0 <= dist_min < dist_max")
    if not 0.0 < alpha < math.inf:
        raise InputError(f"alpha is {alpha}; the exponent must be positive and finite")
    if not 0.0 <= extinct < 1.0:
        raise InputError(f"extinct is {extinct}; it is a share of the level, from 0 to below 1")
    if noise is not None:
        above_noise(dist_min, noise)
    parameters = np.array([level, dist_min, dist_max, alpha, extinct * level, a, b], float)
    outputs, reads = len(QUALITY_OUTPUTS), max(a, b) + 1
    return Controller(_quality_signal, np.zeros(1), parameters, outputs=outputs, reads=reads)


def drop_detector(
    level: float,
    *,
    below: float = 0.7,
    release: float = 0.8,
    noise: float | None = None,
    signal: int = 0,
) -> Controller:
    """Alarm (0 or 1) while a signal has dropped below its clean level.

    It is raised when the signal falls below the share `below` of the level and ends when it is over
    the share `release`. noise: rms of the signal without fault, relative to the level. signal: its
    number among the measurements. Raises InputError unless 0 < below <= release < 1, and when the
    margin 1 - release is not above the noise.

    Examples
    --------
    >>> from workbench.diagnosis import drop_detector
    >>> from workbench.simulation import play
    >>> play(drop_detector(level=2.0), [[2.0], [1.3], [1.5], [1.7]]).ravel().tolist()
    [0.0, 1.0, 1.0, 0.0]
    """
    _check_level(level)
    need_numbers(below=below, release=release)
    if not 0.0 < below <= release < 1.0:
        raise InputError(f"below {below}, release {release}: need 0 < below <= release < 1")
    if noise is not None:
        above_noise(1.0 - release, noise)
    return hysteresis(below * level, release * level, signal=signal, falling=True)


@kernel
def quality(dist: float, dist_min: float, dist_max: float, alpha: float) -> float:
    """Quality (0 to 1) at a distance: 1 up to dist_min, 0 from dist_max on."""
    if dist <= dist_min:
        return 1.0
    if dist >= dist_max:
        return 0.0
    return ((dist_max - dist) / (dist_max - dist_min)) ** alpha


@kernel
def _quality_signal(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """State: the last ratio that could be computed."""
    a, b = measurement[int(parameters[5])], measurement[int(parameters[6])]
    total = a + b
    dist = abs(1.0 - total / parameters[0]) / math.sqrt(2.0)
    output[0] = 0.0
    if total > parameters[4]:
        state[0] = (a - b) / total
        output[0] = quality(dist, parameters[1], parameters[2], parameters[3])
    output[1], output[2] = dist, state[0]


def _check_level(level: float) -> None:
    need_numbers(level=level)
    if not 0.0 < level < math.inf:
        raise InputError(f"level is {level}; without fault it is positive and finite")
