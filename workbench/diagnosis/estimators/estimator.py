"""Estimators of positions and disturbances, corrected by the measurement as far as it is trusted.

    corrected:   x^ + w M (y - C x^)          w: quality of the measurement, 0 to 1
    predicted:   A x^ + B u

At quality 0 the estimator runs in open loop: the oscillators continue to rotate and the plant's
model follows u. (E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players, 2003, section
7.2.2.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import kernel
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.estimators.disturbed import DisturbedPlant, need_model
from workbench.diagnosis.estimators.observers import observer_gain
from workbench.diagnosis.estimators.streaming import (
    HEADER,
    correct,
    layout,
    predict,
    surprise,
    tell,
)
from workbench.errors import InputError
from workbench.input_checks import as_array, need_numbers
from workbench.simulation import Controller, play

MEASURED = ("measurement", "input", "quality")
"""Inputs of a streaming estimator at each sample: y, the u that acts until the next sample, and the
quality of y."""


class Estimate(NamedTuple):
    """Estimates over a record of N samples; each uses the record up to its own sample only.

    outputs (N, z) in the order of `DisturbedPlant.Z`; disturbance (N,); ``frequency_hz`` (N,) [Hz]
    of the rotation.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import DisturbedPlant, Rotation, estimate, placed_estimator
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> poles = np.exp(1e-3 * np.array([-150.0, -200.0]))
    >>> poles = np.concatenate([poles, model.rotation.poles(1e-3, 8.0)])
    >>> estimator = placed_estimator(model, poles)
    >>> found = estimate(estimator.controller, np.zeros(10), np.zeros(10), np.ones(10))
    >>> found.outputs.shape, found.disturbance.shape, found.frequency_hz.tolist()[:1]
    ((10, 1), (10,), [5.0])
    """

    outputs: RealArray
    disturbance: RealArray
    frequency_hz: RealArray


@dataclass(frozen=True, eq=False)
class Estimator:
    """An observer of a disturbed plant with constant gain, scaled by the quality of its input.

    model  of the plant and its disturbance;
    gain   M (seen,) of the correction in the module's first equation.

    Raises InputError if the gain has another shape or leaves the observer unstable.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import DisturbedPlant, Estimator, Rotation, placed_estimator
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> poles = np.exp(1e-3 * np.array([-150.0, -200.0]))
    >>> poles = np.concatenate([poles, model.rotation.poles(1e-3, 8.0)])
    >>> estimator = placed_estimator(model, poles)
    >>> bool(abs(Estimator(model, estimator.gain).poles()).max() < 1)
    True
    """

    model: DisturbedPlant
    gain: RealArray

    def __post_init__(self) -> None:
        need_model(self.model)
        n = self.model.seen
        object.__setattr__(self, "gain", as_array(self.gain, "gain"))
        if np.shape(self.gain) != (n,) or not np.isfinite(self.gain).all():
            raise InputError(f"gain has shape {np.shape(self.gain)}; it must be finite, ({n},)")
        radius = abs(self.poles()).max()
        if not radius < 1.0:
            raise InputError(f"the observer with this gain is unstable: |z| = {radius:.6g}")

    def poles(self, *, quality: float = 1.0) -> ComplexArray:
        """The discrete poles (seen,) of the observer at a constant quality, 0 to 1.

        An observer that is stable at quality 1 may be unstable at a lower one: check those too.
        """
        _check_quality(quality)
        n = self.model.seen
        A, C = self.model.A[:n, :n], self.model.C[:n]
        return np.linalg.eigvals(A - quality * np.outer(A @ self.gain, C)).astype(complex)

    def system(self, *, quality: float = 1.0) -> StateSpace:
        """The observer at a constant quality, from (y, u) to the outputs (z,) and the disturbance.

        u is the one that acts until the next sample. Raises InputError as `poles`.
        """
        import control

        _check_quality(quality)
        model = self.model
        gain = np.zeros(len(model.A))
        gain[: model.seen] = quality * self.gain
        kept = np.eye(len(gain)) - np.outer(gain, model.C)
        turning = np.zeros((1, len(gain)))
        turning[0, : model.disturbance.size] = model.disturbance
        told = np.vstack([model.Z, turning])
        return control.StateSpace(
            model.A @ kept,
            np.column_stack([model.A @ gain, model.B]),
            told @ kept,
            np.column_stack([told @ gain, np.zeros(len(told))]),
            model.dt,
            inputs=list(MEASURED[:2]),
            remove_useless_states=False,
        )

    @cached_property
    def controller(self) -> Controller:
        """The streaming estimator, from `MEASURED` to outputs (z,), disturbance and frequency [Hz].

        A quality outside 0 to 1 makes its outputs NaN, which every run reports.
        """
        model = self.model
        padded = np.zeros(len(model.A))
        padded[: model.seen] = self.gain
        state = np.zeros(2 * len(padded) + 1)
        state[-1] = model.rotation.frequency_hz
        outputs = len(model.Z) + 2
        return Controller(
            _step, state, layout(model, padded), outputs=outputs, reads=3, dt=model.dt
        )


def _check_quality(quality: float) -> None:
    need_numbers(quality=quality)
    if not 0.0 <= quality <= 1.0:
        raise InputError(f"quality is {quality}; it must be 0 to 1")


def placed_estimator(model: DisturbedPlant, poles: ArrayLike) -> Estimator:
    """The estimator with these discrete poles (seen,); raises InputError as `observer_gain`.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import DisturbedPlant, Rotation, placed_estimator
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> poles = np.exp(1e-3 * np.array([-150.0, -200.0]))
    >>> poles = np.concatenate([poles, model.rotation.poles(1e-3, 8.0)])
    >>> estimator = placed_estimator(model, poles)
    >>> bool(
    ...     np.isclose(abs(estimator.poles()).max(), np.exp(-8.0 * 1e-3))
    ... )  # the oscillator's decay
    True
    """
    need_model(model)
    n = model.seen
    A, C = model.A[:n, :n], model.C[None, :n]
    L = observer_gain(A, C, poles, dt=model.dt)[:, 0]
    return Estimator(model, np.linalg.solve(A, L).astype(float))


def estimate(
    controller: Controller, measurement: ArrayLike, known: ArrayLike, quality: ArrayLike
) -> Estimate:
    """The estimates of a streaming estimator for a record of y, u and quality, each (N,).

    Raises InputError for lengths that differ, values that are not finite, or a quality outside 0
    to 1.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import DisturbedPlant, Rotation, estimate, placed_estimator
    >>> from workbench.simulation import sampled_model
    >>> A, B = [[0.0, 1.0], [-400.0, -25.0]], [[0.0, 0.0], [400.0, 400.0]]
    >>> lens = control.ss(A, B, [[1.0, 0.0]], 0.0)
    >>> model = DisturbedPlant(sampled_model(lens, 1e-3), Rotation(frequency_hz=5.0))
    >>> poles = np.exp(1e-3 * np.array([-150.0, -200.0]))
    >>> poles = np.concatenate([poles, model.rotation.poles(1e-3, 8.0)])
    >>> estimator = placed_estimator(model, poles)
    >>> d = np.sin(2 * np.pi * 5.0 * 1e-3 * np.arange(3000))
    >>> y = control.forced_response(model.plant, inputs=[0 * d, d]).outputs.ravel()
    >>> found = estimate(estimator.controller, y, 0 * d, np.ones(3000))
    >>> bool(abs(found.disturbance - d)[-100:].max() < 1e-3)
    True
    """
    given = dict(zip(MEASURED, (measurement, known, quality), strict=True))
    columns = [as_array(values, f"the {name}") for name, values in given.items()]
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
    played = play(controller, np.column_stack(columns))
    return Estimate(played[:, :-2], played[:, -2], played[:, -1])


@kernel
def _step(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    n, h = int(parameters[0]), int(parameters[3])
    quality = measurement[2]
    error = surprise(state, parameters, measurement[0])
    correct(state, parameters, quality * error, parameters[HEADER + h : HEADER + h + n])
    tell(state, parameters, quality, output)
    predict(state, parameters, measurement[1])
