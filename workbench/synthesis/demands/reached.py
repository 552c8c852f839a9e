"""The value that a loop reaches for each demand, from its signals or its frequency responses."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.fitting.rational import Rational
from workbench.synthesis.demands.demands import PEAK_SENSITIVITY, RECOVERED, SETTLED, Demands
from workbench.systems.generalised_plant import response

FREQUENCIES = 2000
"""Number of frequencies at which a loop is evaluated."""
SLOWEST = 1e-5
"""The lowest of these frequencies, relative to half the sampling rate."""


def step_quality(share: RealArray, dt: float) -> tuple[RealArray, RealArray]:
    """Overshoot and settling time [s] of steps (..., samples) from 0 to 1 at the first sample."""
    settling = _samples_until_inside(np.abs(share - 1) > SETTLED) * dt
    return np.maximum(share.max(axis=-1) - 1, 0.0), settling


def recovery_time(deviation: RealArray, dt: float) -> RealArray:
    """Time [s] until deviations (..., samples) stay below a tenth of their largest size."""
    size = np.abs(deviation)
    return _samples_until_inside(size > RECOVERED * size.max(axis=-1, keepdims=True)) * dt


def _samples_until_inside(outside: np.ndarray) -> RealArray:
    """Number of samples up to the last one that is outside the limits."""
    count = outside.shape[-1] - np.argmax(outside[..., ::-1], axis=-1)
    found: RealArray = np.where(outside.any(axis=-1), count, 0).astype(float)
    return found


def reached_by_responses(
    plant: StateSpace, controller: StateSpace, sign: int, demands: Demands, nominal: Rational
) -> dict[str, float]:
    """The bandwidth [rad/s] and the effort, 1 over the control gain, that a sampled loop reaches.

    The bandwidth is the largest one for which |S| satisfies its weight at the frequencies where |S|
    is below 1.
    """
    assert plant.dt
    end = np.pi / plant.dt
    omega = np.geomspace(SLOWEST * end, 0.999 * end, FREQUENCIES)
    G, K = (response(one, omega)[:, 0, 0] for one in (plant, -sign * controller))
    S = 1 / (1 + G * K)
    found = {}
    if demands.bandwidth is not None:
        size = np.abs(S)
        below = size[: int(np.argmax(size >= 1)) or size.size]
        within = omega[: below.size] * np.sqrt(np.maximum(below**-2 - PEAK_SENSITIVITY**-2, 0))
        found["bandwidth"] = float(within.min(initial=np.inf))
    if demands.effort is not None:
        (weight,) = demands.only(["effort"]).weights(nominal, plant.dt, beside=demands)
        size = np.abs(weight.W.response(omega) * K * S)
        found["effort"] = demands.effort / float(size.max())
    return found
