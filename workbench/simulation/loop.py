"""A sampled controller around a continuous plant that a nonlinear sensor watches.

    controller -> + -> D/A -> delay -> linear plant -> positions -> sensor -> filter -> A/D -+
        ^         excitation               |               exogenous signals                 |
        |                                  +-> further outputs --------------------> A/D ----+
        +----------------------------------- reading <---------------------------------------+

Three compiled functions make it particular: `sense(position, exogenous, parameters, signals)` is
the sensor, `read(channels, parameters, measurement)` what the processor makes of the converted
channels, and the controller's step. They are called through pointers, so the loop itself is
compiled once, whatever it is given.

The plant is advanced exactly, its inputs being held. Between samples the exogenous signals are
interpolated linearly and the sensor's signals quadratically, the latter through three points in
each of `refine` steps before and after the input changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.errors import InputError
from workbench.simulation.controllers import Controller
from workbench.simulation.discretise import hold, lowpass_weights, split_delay
from workbench.simulation.machine import machine, pointer

if TYPE_CHECKING:
    from control import StateSpace

Real = NDArray[np.float64]
Whole = NDArray[np.int64]


class Trajectory(NamedTuple):
    """What a run recorded at its N sampling instants.

    command (N, m) before the D/A converter, excitation included; output (N, m) behind it, before
    the delay; channels (N, c) as converted; measurement (N, r) as read; position (N, q) true.
    Saturated samples are counted by output (m,) and by channel (c,).
    """

    command: Real
    output: Real
    channels: Real
    measurement: Real
    position: Real
    saturated_outputs: Whole
    saturated_channels: Whole


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """All of the loop but the controller.

    plant         strictly proper system; its first `positions` outputs go to the sensor, the others
                  are channels, behind the sensor's;
    sense         compiled sensor: position (q,), exogenous (w,), sense_parameters -> signals (s,);
    corner        of the first-order filter of every sensor signal [rad/s];
    read          compiled reading: channels (c,), read_parameters -> measurement (r,);
    converters    levels (c, 3) of the channels and (m, 3) of the outputs, see `Converter.levels`;
    period [s]; delay [samples], any real number; refine: steps between samples, see above.
    """

    plant: StateSpace
    positions: int
    sense: Any
    sense_parameters: Real
    signals: int
    corner: float
    read: Any
    read_parameters: Real
    measurements: int
    channel_levels: Real
    output_levels: Real
    period: float
    delay: float = 0.0
    refine: int = 1

    def __post_init__(self) -> None:
        if np.any(self.plant.D):
            raise InputError("the plant has a direct feedthrough; filter its outputs first")
        if self.refine < 1:
            raise InputError(f"refine is {self.refine}; it must be 1 or more")
        channels = self.signals + self.plant.noutputs - self.positions
        if self.channel_levels.shape != (channels, 3):
            raise InputError(f"channel_levels: {self.channel_levels.shape}, need ({channels}, 3)")
        if self.output_levels.shape != (self.plant.ninputs, 3):
            raise InputError(
                f"output_levels: {self.output_levels.shape}, need ({self.plant.ninputs}, 3)"
            )

    def run(
        self, controller: Controller, excitation: ArrayLike, exogenous: ArrayLike, noise: ArrayLike
    ) -> Trajectory:
        """Run from rest for N samples.

        excitation (N, m) adds to the controller's output; exogenous (N + 1, w) at the sampling
        instants and one after; noise (N, c) adds to the channels before they are converted.
        Raises InputError for other shapes, for values that are not finite, and when the controller
        gives one.
        """
        exogenous = _checked("exogenous", exogenous, None, None)
        samples, m, c = len(exogenous) - 1, self.plant.ninputs, len(self.channel_levels)
        excitation = _checked("excitation", excitation, samples, m)
        noise = _checked("noise", noise, samples, c)
        if controller.outputs != m:
            raise InputError(f"{controller.outputs} controller outputs, {m} inputs of the plant")
        controller.need_measurements(self.measurements)
        sizes = (m, m, c, self.measurements, self.positions)
        command, output, channels, measurement, position = (np.zeros((samples, n)) for n in sizes)
        counts = np.zeros(m, np.int64), np.zeros(c, np.int64)
        recorded = Trajectory(command, output, channels, measurement, position, *counts)
        kernels = (controller.step, self.sense, self.read)
        for kernel, arguments in zip(kernels, (4, 4, 3), strict=True):
            kernel.compile(pointer(arguments).signature)
        stop = machine()(
            *kernels,
            np.array(controller.state, float),
            np.array(controller.parameters, float),
            self.sense_parameters,
            self.read_parameters,
            *self._advance(),
            np.ascontiguousarray(self.plant.C),
            self.channel_levels,
            self.output_levels,
            excitation,
            exogenous,
            noise,
            *recorded,
        )
        if stop < samples:
            raise InputError(f"the controller's output is not finite at sample {stop} of {samples}")
        return recorded

    def _advance(self) -> tuple[Real, Real, Whole, Real, Real]:
        """Matrices of each half step (H, ...) of a period, and weights of each step (H / 2, 4).

        Also the age [samples] of the input that is held, and the fraction of the period at the
        end of each half step.
        """
        whole, rest = split_delay(self.delay)
        pieces = [(rest, whole + 1), (1.0 - rest, whole)] if rest > 0.0 else [(1.0, whole)]
        transition, drive, age, length, weights = [], [], [], [], []
        for share, old in pieces:
            step = share / self.refine
            matrices = hold(self.plant.A, self.plant.B, step / 2 * self.period)
            weight = lowpass_weights(self.corner, step * self.period)
            for _ in range(self.refine):
                weights.append(weight)
                for _ in range(2):
                    transition.append(matrices[0])
                    drive.append(matrices[1])
                    age.append(old)
                    length.append(step / 2)
        ages, ends = np.array(age, np.int64), np.cumsum(length)
        return np.array(transition), np.array(drive), ages, ends, np.array(weights)


def _checked(name: str, values: ArrayLike, rows: int | None, columns: int | None) -> Real:
    array = np.ascontiguousarray(values, float)
    wanted = tuple("N" if size is None else size for size in (rows, columns))
    fits = array.ndim == 2 and all(
        size in (None, given) for size, given in zip((rows, columns), array.shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name} has shape {array.shape}; it must be {wanted}")
    if not np.isfinite(array).all():
        raise InputError(
            f"{name} has values that are not finite, first in row "
            f"{np.flatnonzero(~np.isfinite(array).all(axis=1))[0]}"
        )
    return array
