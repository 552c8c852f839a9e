"""Surface defects as the diodes' sum shows them: the quality signal, and the binary detector.

The quality signal is that of eq. 7.13-7.14, a credibility between 0 and 1; the binary detector,
which every player has, says defect or none (section 7.1.2). Equation and section numbers refer to
E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import RealArray
from workbench.compiled import kernel
from workbench.diagnosis import above_noise, hysteresis
from workbench.errors import InputError
from workbench.input_checks import as_array, need_numbers
from workbench.simulation import Controller

from ..laboratory.experiment import MEASUREMENTS

OUTPUTS = ("quality", "dist", "error")
"""What the quality signal's controller gives."""
FARTHEST = 1.0 / math.sqrt(2.0)
"""Distance of darkness, d1 = d2 = 0, from the linear area."""
DARK = 0.02
"""Share of the clean disc's light below which no error can be read from the diodes."""


def clean_level(total: ArrayLike) -> float:
    """Level of a clean disc's sum signal [V]: the median of a record (N,).

    Defects dim the light for less than half of the time, so they do not move it. Raises InputError
    for a record that is empty or not finite, and without light.
    """
    record = as_array(total, "the sum signal")
    if record.ndim != 1 or not record.size or not np.isfinite(record).all():
        raise InputError(
            f"the sum signal has shape {record.shape}; it must be (N,), finite, not none"
        )
    level = float(np.median(record))
    if level <= 0.0:
        raise InputError(f"the median of the sum signal is {level:.4g} V: there is no light")
    return level


def quality_signal(
    level: float, dist_min: float, dist_max: float, alpha: float = 1.0, noise: float | None = None
) -> Controller:
    """Quality, distance from the linear area and normalised error, from the laboratory's signals.

        d1n = d1 / level,   d2n = d2 / level,   dist = |1 - d1n - d2n| / sqrt(2)   (eq. 7.14),
        quality = 1 up to dist_min, 0 from dist_max on, between them
                  ((dist_max - dist) / (dist_max - dist_min))^alpha                (eq. 7.13).

    The error (d1 - d2) / (d1 + d2) is held while the sum is below DARK of the level, where it would
    divide noise by noise; the quality is 0 there, however large dist_max.

    level       of a clean disc's sum [V], so that d1n + d2n = 1 on it, see `clean_level`;
    dist_min    security margin above the noise; dist_max: no credibility from here on;
    noise       rms of dist on a clean disc, to be checked against dist_min where it is given.

    Raises InputError unless 0 <= dist_min < dist_max, alpha > 0 and level > 0, all finite, and when
    dist_min is not above the noise.
    """
    _check_level(level)
    need_numbers(dist_min=dist_min, dist_max=dist_max, alpha=alpha)
    if not 0.0 <= dist_min < dist_max < math.inf:
        raise InputError(f"dist_min {dist_min}, dist_max {dist_max}: need 0 <= dist_min < dist_max")
    if not 0.0 < alpha < math.inf:
        raise InputError(f"alpha is {alpha}; the exponent must be positive and finite")
    if noise is not None:
        above_noise(dist_min, noise)
    diodes = [MEASUREMENTS.index(name) for name in ("d1", "d2")]
    parameters = np.array([level, dist_min, dist_max, alpha, DARK * level, *diodes], float)
    return Controller(_quality_signal, np.zeros(1), parameters, len(OUTPUTS), len(MEASUREMENTS))


def binary_detector(
    level: float, below: float = 0.7, release: float = 0.8, noise: float | None = None
) -> Controller:
    """Alarm (0 or 1) from when the sum falls below a share of the clean level, until it is back.

    It is raised when the sum is under `below` times the level and ends over `release` times it. The
    noise is the rms of the sum on a clean disc over its level. Raises InputError unless
    0 < below <= release, and when the margin 1 - release is not above the noise.
    """
    _check_level(level)
    need_numbers(below=below, release=release)
    if not 0.0 < below <= release < 1.0:
        raise InputError(f"below {below}, release {release}: need 0 < below <= release < 1")
    if noise is not None:
        above_noise(1.0 - release, noise)
    total = MEASUREMENTS.index("sum")
    return hysteresis(below * level, release * level, total, falling=True)


@kernel
def quality(dist: float, dist_min: float, dist_max: float, alpha: float) -> float:
    """Equation 7.13."""
    if dist <= dist_min:
        return 1.0
    if dist >= dist_max:
        return 0.0
    return ((dist_max - dist) / (dist_max - dist_min)) ** alpha


@kernel
def _quality_signal(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """State: the last error that could be read."""
    d1, d2 = measurement[int(parameters[5])], measurement[int(parameters[6])]
    total = d1 + d2
    dist = abs(1.0 - total / parameters[0]) / math.sqrt(2.0)
    output[0] = 0.0
    if total > parameters[4]:
        state[0] = (d1 - d2) / total
        output[0] = quality(dist, parameters[1], parameters[2], parameters[3])
    output[1], output[2] = dist, state[0]


def _check_level(level: float) -> None:
    need_numbers(level=level)
    if not 0.0 < level < math.inf:
        raise InputError(f"level is {level} V; a clean disc gives a positive, finite one")
