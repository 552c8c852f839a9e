"""The compiled steps of a streaming estimator in each sample: surprise, correct, tell, predict.

The state is (x^, work space for the next x^, rotation frequency [Hz]); a filter may append more.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import inlined
from workbench.diagnosis.estimators.disturbed import DisturbedPlant

HEADER = 10
"""Length of the header of a step's parameters, which precedes the harmonics and the matrices. It
holds the numbers of states, outputs, plant states, oscillators and seen states, the period, and the
frequency loop's rate, lowest and highest frequency, and floor.
"""


def layout(model: DisturbedPlant, gain: RealArray) -> RealArray:
    """The parameters of a step: the header, the harmonics, then M, B, C, Z, A."""
    rotation, (plant, _, colour, _) = model.rotation, model.slices
    header = np.zeros(HEADER)
    header[:5] = len(model.A), len(model.Z), plant.stop, len(rotation.harmonics), colour.stop
    header[5:10] = model.dt, rotation.adaptation, *rotation.limits_hz, rotation.floor
    values = (rotation.harmonics, gain, model.B, model.C, model.Z.ravel(), model.A.ravel())
    return np.concatenate([header, *(np.asarray(one, float) for one in values)])


@inlined
def surprise(state: RealArray, p: RealArray, measured: float) -> float:
    """The prediction error: the measurement less its prediction C x^."""
    n, h, seen = int(p[0]), int(p[3]), int(p[4])
    at_c = HEADER + h + 2 * n
    for i in range(seen):
        measured -= p[at_c + i] * state[i]
    return measured


@inlined
def correct(state: RealArray, p: RealArray, step: float, gain: RealArray) -> None:
    """Correct the state by gain times `step`, which is w (y - C x^), and follow the frequency.

    The frequency moves by the angle through which the correction turns the first oscillator.
    """
    q, seen, at_frequency = int(p[2]), int(p[4]), 2 * int(p[0])
    if p[6] > 0.0:
        cosine, sine = state[q], state[q + 1]
        size = cosine * cosine + sine * sine + p[9] * p[9]
        if size > 0.0:
            turned = step * (cosine * gain[q + 1] - sine * gain[q]) / size
            frequency = state[at_frequency] + p[6] * turned / (2.0 * np.pi)
            state[at_frequency] = min(max(frequency, p[7]), p[8])
    for i in range(seen):
        state[i] += step * gain[i]


@inlined
def tell(state: RealArray, p: RealArray, quality: float, output: RealArray) -> None:
    """Fill the outputs from the corrected state."""
    n, z, q, h = int(p[0]), int(p[1]), int(p[2]), int(p[3])
    at_z = HEADER + h + 3 * n
    for i in range(z):
        output[i] = 0.0
        for j in range(n):
            output[i] += p[at_z + i * n + j] * state[j]
    output[z] = _disturbance(state, q, h)
    output[z + 1] = state[2 * n]
    if not 0.0 <= quality <= 1.0:
        output[:] = np.nan


@inlined
def predict(state: RealArray, p: RealArray, known: float) -> None:
    """Advance the state by one sample, block by block, oscillators at the followed frequency."""
    n, z, q, h, seen = int(p[0]), int(p[1]), int(p[2]), int(p[3]), int(p[4])
    at_b, at_a = HEADER + h + n, HEADER + h + (3 + z) * n
    disturbance = _disturbance(state, q, h)
    for i in range(q):
        # Every oscillator enters the plant in the same way, so the first one's column serves for
        # all.
        state[n + i] = p[at_b + i] * known + p[at_a + i * n + q] * disturbance
        for j in range(q):
            state[n + i] += p[at_a + i * n + j] * state[j]
    for k in range(h):
        i, angle = q + 2 * k, 2.0 * np.pi * p[HEADER + k] * state[2 * n] * p[5]
        c, s = np.cos(angle), np.sin(angle)
        state[n + i] = c * state[i] - s * state[i + 1]
        state[n + i + 1] = s * state[i] + c * state[i + 1]
    for start, stop in ((q + 2 * h, seen), (seen, n)):
        for i in range(start, stop):
            state[n + i] = p[at_b + i] * known
            for j in range(start, stop):
                state[n + i] += p[at_a + i * n + j] * state[j]
    for i in range(n):
        state[i] = state[n + i]


@inlined
def _disturbance(state: RealArray, first: int, oscillators: int) -> float:
    total = 0.0
    for k in range(oscillators):
        total += state[first + 2 * k]
    return total
