"""Positions and disturbances estimated sample by sample, as far as the measurement can be trusted.

    corrected:   x^ + w M (y - C x^)          w: quality of the measurement, 0 to 1
    predicted:   A x^ + B u

At quality 0 the estimator runs in open loop: the oscillators go on turning and the plant's model
follows u. (E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players, 2003, section 7.2.2.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.compiled import compiled
from workbench.diagnosis.disturbed import DisturbedPlant
from workbench.diagnosis.observers import observer_gain
from workbench.errors import InputError
from workbench.simulation import Controller, play

Real = NDArray[np.float64]

HEADER = 10
"""Numbers in front of the matrices among the parameters of a step."""
MEASURED = ("measurement", "input", "quality")
"""What a streaming estimator is given each sample: y, the u that acts from this sample to the next,
and the quality of y."""


class Estimate(NamedTuple):
    """An estimator over a record of N samples; each value from what was known at that sample.

    outputs (N, z) as `DisturbedPlant.Z`; disturbance (N,); frequency of the rotation (N,) [Hz].
    """

    outputs: Real
    disturbance: Real
    frequency: Real


@dataclass(frozen=True, eq=False)
class Estimator:
    """An observer of a disturbed plant with constant gain, scaled by the quality of its input.

    model  what it believes; gain M (seen,) of the correction, see the module.

    Raises InputError when the gain has another shape or leaves the observer unstable.
    """

    model: DisturbedPlant
    gain: Real

    def __post_init__(self) -> None:
        n = self.model.seen
        if np.shape(self.gain) != (n,) or not np.isfinite(self.gain).all():
            raise InputError(f"gain has shape {np.shape(self.gain)}; it must be finite, ({n},)")
        radius = abs(self.poles).max()
        if not radius < 1.0:
            raise InputError(f"the observer with this gain is unstable: |z| = {radius:.6g}")

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Discrete poles (seen,) of the observer at quality 1."""
        n = self.model.seen
        A, C = self.model.A[:n, :n], self.model.C[:n]
        poles: NDArray[np.complex128] = np.linalg.eigvals(A - np.outer(A @ self.gain, C))
        return poles

    @cached_property
    def controller(self) -> Controller:
        """The streaming estimator: `MEASURED` -> outputs (z,), disturbance, frequency [Hz].

        A quality outside 0 to 1 makes its outputs NaN, which every run reports.
        """
        model = self.model
        padded = np.zeros(len(model.A))
        padded[: model.seen] = self.gain
        state = np.zeros(2 * len(padded) + 1)
        state[-1] = model.rotation.frequency
        return Controller(_step, state, layout(model, padded), len(model.Z) + 2)


def placed(model: DisturbedPlant, poles: ArrayLike) -> Estimator:
    """The estimator whose `seen` poles are these discrete ones; InputError as `observer_gain`."""
    n = model.seen
    A, C = model.A[:n, :n], model.C[None, :n]
    L = observer_gain(A, C, poles, model.period)[:, 0]
    return Estimator(model, np.linalg.solve(A, L))


def estimate(
    controller: Controller, measurement: ArrayLike, known: ArrayLike, quality: ArrayLike
) -> Estimate:
    """Run a streaming estimator over a record: y, u and quality, each (N,).

    Raises InputError for lengths that differ, values that are not finite, a quality outside 0 to 1.
    """
    columns = [np.asarray(values, float) for values in (measurement, known, quality)]
    if len({column.shape for column in columns}) != 1 or columns[0].ndim != 1:
        shapes = {name: one.shape for name, one in zip(MEASURED, columns, strict=True)}
        raise InputError(f"shapes differ or are not (N,): {shapes}")
    for name, column in zip(MEASURED, columns, strict=True):
        if not np.isfinite(column).all():
            row = np.flatnonzero(~np.isfinite(column))[0]
            raise InputError(f"the {name} is not finite at sample {row}")
    outside = np.flatnonzero((columns[2] < 0.0) | (columns[2] > 1.0))
    if outside.size:
        row = outside[0]
        raise InputError(f"quality is {columns[2][row]} at sample {row}; it must be 0 to 1")
    given = play(controller, np.column_stack(columns))
    return Estimate(given[:, :-2], given[:, -2], given[:, -1])


def layout(model: DisturbedPlant, gain: Real) -> Real:
    """Parameters of a step: sizes, frequency loop, harmonics, then M, B, C, Z, A."""
    rotation, (plant, _, colour, _) = model.rotation, model.slices
    header = np.zeros(HEADER)
    header[:5] = len(model.A), len(model.Z), plant.stop, len(rotation.harmonics), colour.stop
    header[5:10] = model.period, rotation.adaptation, *rotation.limits, rotation.floor
    values = (rotation.harmonics, gain, model.B, model.C, model.Z.ravel(), model.A.ravel())
    return np.concatenate([header, *(np.asarray(one, float) for one in values)])


@compiled
def surprise(state: Real, p: Real, measured: float) -> float:
    """What was measured less what was expected."""
    n, h, seen = int(p[0]), int(p[3]), int(p[4])
    at_c = HEADER + h + 2 * n
    for i in range(seen):
        measured -= p[at_c + i] * state[i]
    return measured


@compiled
def correct(state: Real, p: Real, step: float, gain: Real) -> None:
    """Correct the state by gain times `step`, w (y - C x^), and follow the frequency.

    The correction turns the first oscillator by the rotation that is missing.
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


@compiled
def tell(state: Real, p: Real, quality: float, output: Real) -> None:
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


@compiled
def predict(state: Real, p: Real, known: float) -> None:
    """Advance the state by one sample, block by block; the oscillators at the frequency followed."""
    n, z, q, h, seen = int(p[0]), int(p[1]), int(p[2]), int(p[3]), int(p[4])
    at_b, at_a = HEADER + h + n, HEADER + h + (3 + z) * n
    disturbance = _disturbance(state, q, h)
    for i in range(q):
        # Every oscillator enters the plant alike, so the first one's column serves them all.
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


@compiled
def _disturbance(state: Real, first: int, oscillators: int) -> float:
    total = 0.0
    for k in range(oscillators):
        total += state[first + 2 * k]
    return total


@compiled
def _step(state: Real, parameters: Real, measurement: Real, output: Real) -> None:
    n, h = int(parameters[0]), int(parameters[3])
    quality = measurement[2]
    error = surprise(state, parameters, measurement[0])
    correct(state, parameters, quality * error, parameters[HEADER + h : HEADER + h + n])
    tell(state, parameters, quality, output)
    predict(state, parameters, measurement[1])
