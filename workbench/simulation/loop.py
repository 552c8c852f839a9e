"""Loop of a sampled controller and a continuous plant, measured by a nonlinear sensor.

    controller -> + -> D/A -> delay -> linear plant -> positions -> sensor -> filter -> A/D -+
        ^         excitation               |               exogenous signals                 |
        |                                  +-> further outputs --------------------> A/D ----+
        +----------------------------------- reading <---------------------------------------+

Three kinds of compiled functions define a particular loop: `sense(position, exogenous, parameters,
signals)` is the sensor, `read(channels, parameters, measurement)` is the processor's computation of
measurements from converted channels, and the steps are those of the controller, which may be a
cascade of parts and may change at given times. They are called through pointers, so the loop itself
is compiled only once.

The plant is advanced exactly for inputs that are held constant. Between samples the exogenous
signals are interpolated linearly and the sensor's signals quadratically: through three points in
each of `refine` steps before, and `refine` steps after, the input changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import IntegerArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.simulation.cascade import Cascade, Turn, alone, carried, turns
from workbench.simulation.controllers import Controller
from workbench.simulation.plain import plain_loop
from workbench.simulation.road import SIMULATION
from workbench.systems.sampling import held_input_matrices, lowpass_weights, split_delay

Schedule = Sequence[tuple[float, Cascade]]
"""Cascades with the times [s] from which each is in charge, in rising order, the first from 0.

A part continues from the state of the last part of the same name; others start from their initial
state.
"""


class Trajectory(NamedTuple):
    """Signals of a run at its N sampling instants.

    command             (N, m) before the D/A converter, including the excitation;
    output              (N, m) after the D/A converter, before the delay;
    channels            (N, c) after the A/D converters;
    measurement         (N, r) as read;
    position            (N, q), the true one;
    saturated_outputs   (m,) number of saturated samples of each output;
    saturated_channels  (c,) number of saturated samples of each channel;
    signals             (N,) for each name: outputs of the parts, NaN while there is no such part.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench._core.compiled import compiled
    >>> from workbench.simulation import SampledLoop, linear_controller
    >>> @compiled
    ... def sense(position, exogenous, parameters, signals):
    ...     signals[0] = exogenous[0] - position[0]
    ...
    >>> @compiled
    ... def read(channels, parameters, measurement):
    ...     measurement[:] = channels
    ...
    >>> G = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> wide = np.array([[0.0, -100.0, 100.0]])  # converters without steps
    >>> none = np.zeros(0)
    >>> loop = SampledLoop(G, sense, none, read, none, wide, wide, 1, 1, 1, 1e4, 0.01)
    >>> K, nothing = linear_controller(control.tf(9, 1, 0.01), 0.01), np.zeros((500, 1))
    >>> found = loop.run(K, excitation=nothing, exogenous=np.ones((501, 1)), noise=nothing)
    >>> found.command.shape, found.saturated_outputs.tolist()
    ((500, 1), [0])
    """

    command: RealArray
    output: RealArray
    channels: RealArray
    measurement: RealArray
    position: RealArray
    saturated_outputs: IntegerArray
    saturated_channels: IntegerArray
    signals: dict[str, RealArray]


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """The whole loop except its controller.

    Unlike a closed `StateSpace`, it is simulated: sensor and signals are any compiled
    functions.

    plant             strictly proper system; its first `positions` outputs go to the sensor, the
                      others are channels that follow those of the sensor;
    sense             compiled sensor: position (q,), exogenous (w,), sense_parameters -> signals
                      (s,);
    signals           number s of the sensor's signals;
    corner            corner frequency [rad/s] of the first-order filter of every sensor signal;
    read              compiled reading: channels (c,), read_parameters -> measurement (r,);
    measurements      number r of measurements;
    channel_levels    levels (c, 3) of the channels' converters, see `Converter.levels`;
    output_levels     levels (m, 3) of the outputs' converters;
    dt            sampling period [s];
    delay_samples             delay of the outputs [samples], any real number from 0;
    refine            number of steps between samples, see above.

    Raises InputError for a plant with direct feedthrough, and for levels of other shapes.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench._core.compiled import compiled
    >>> from workbench.simulation import SampledLoop, linear_controller
    >>> @compiled
    ... def sense(position, exogenous, parameters, signals):
    ...     signals[0] = exogenous[0] - position[0]
    ...
    >>> @compiled
    ... def read(channels, parameters, measurement):
    ...     measurement[:] = channels
    ...
    >>> G = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> wide = np.array([[0.0, -100.0, 100.0]])  # converters without steps
    >>> none = np.zeros(0)
    >>> loop = SampledLoop(G, sense, none, read, none, wide, wide, 1, 1, 1, 1e4, 0.01)
    >>> K, nothing = linear_controller(control.tf(9, 1, 0.01), 0.01), np.zeros((500, 1))
    >>> found = loop.run(K, excitation=nothing, exogenous=np.ones((501, 1)), noise=nothing)
    >>> round(float(found.position[-1, 0]), 4)  # 9 / (1 + 9)
    0.9
    """

    plant: StateSpace
    sense: Any
    sense_parameters: RealArray
    read: Any
    read_parameters: RealArray
    channel_levels: RealArray
    output_levels: RealArray
    positions: int
    signals: int
    measurements: int
    corner: float
    dt: float
    _: KW_ONLY
    delay_samples: float = 0.0
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
        self,
        controller: Controller | Cascade | Schedule,
        excitation: ArrayLike,
        exogenous: ArrayLike,
        noise: ArrayLike,
    ) -> Trajectory:
        """Simulate the loop from rest for N samples.

        controller  a controller, a cascade, or a schedule of cascades;
        excitation  (N, m), added to the controller's output;
        exogenous   (N + 1, w), signals at the sampling instants and at the next one;
        noise       (N, c), added to the channels before they are converted.

        Raises InputError for other shapes, for values that are not finite, for a controller with
        another sampling period, for a schedule that is out of order or longer than the record, and
        if an output of a part is not finite; the message says which, and when.
        """
        exogenous = _checked("exogenous", exogenous, None, None)
        samples, m, c = len(exogenous) - 1, self.plant.ninputs, len(self.channel_levels)
        excitation = _checked("excitation", excitation, samples, m)
        noise = _checked("noise", noise, samples, c)
        # Every entry is written before it is read; a run that stops early has no trajectory.
        sizes = (m, m, c, self.positions)
        command, output, channels, position = (np.empty((samples, n)) for n in sizes)
        counts = np.zeros(m, np.int64), np.zeros(c, np.int64)
        measured: list[RealArray] = []
        signals: dict[str, RealArray] = {}
        q, s = self.positions, self.signals
        start = np.zeros(s)
        self.sense(np.zeros(q), exogenous[0].copy(), self.sense_parameters, start)
        n = self.plant.nstates
        desk = (c, n, exogenous.shape[1], s, s)
        rest = (
            (np.zeros(n), np.zeros(q), start.copy(), start),
            tuple(np.zeros(size) for size in desk),
            (*self._advance, np.ascontiguousarray(self.plant.C)),
            (self.channel_levels, self.output_levels),
            (excitation, exogenous, noise),
            (command, output, channels, position, *counts),
        )
        states: dict[str, RealArray] = {}
        for first, last, cascade in self._stages(controller, samples):
            row = np.zeros(len(cascade.signals))
            made = turns(cascade, states, row)
            told = self._stage(cascade, made, row, rest, first, last, samples)
            for part, turn in zip(cascade.parts, made, strict=True):
                states[part.name] = turn.state[: carried(part)]
            given = len(cascade.measurements)
            measured.append(told[:, :given])
            for name, column in zip(cascade.signals[given:], told.T[given:], strict=True):
                if last - first == samples:
                    signals[name] = column
                else:
                    signals.setdefault(name, np.full(samples, np.nan))[first:last] = column
        measurement = measured[0] if len(measured) == 1 else np.concatenate(measured)
        return Trajectory(command, output, channels, measurement, position, *counts, signals)

    def _stages(
        self, controller: Controller | Cascade | Schedule, samples: int
    ) -> list[tuple[int, int, Cascade]]:
        """Stages of the schedule: first sample, sample after the last, and cascade of each."""
        if isinstance(controller, Controller):
            controller = alone(controller, self.measurements)
        schedule = [(0.0, controller)] if isinstance(controller, Cascade) else list(controller)
        times = [time for time, _ in schedule]
        starts = [round(time / self.dt) for time in times]
        ordered = all(a < b for a, b in pairwise([*starts, samples]))
        if not starts or starts[0] != 0 or not ordered:
            raise InputError(
                f"stages start at {times} s; the first must start at 0, each later than the one "
                f"before, and the last before the end at {samples * self.dt:.6g} s"
            )
        for _, cascade in schedule:
            outputs = len(cascade.previous)
            if outputs != self.plant.ninputs:
                raise InputError(
                    f"{outputs} controller outputs, {self.plant.ninputs} inputs of the plant"
                )
            if len(cascade.measurements) != self.measurements:
                raise InputError(
                    f"a cascade of {len(cascade.measurements)} measurements; the loop has "
                    f"{self.measurements}"
                )
            cascade.check_period(self.dt)
        cascades = [cascade for _, cascade in schedule]
        return list(zip(starts, [*starts[1:], samples], cascades, strict=True))

    def _stage(
        self,
        cascade: Cascade,
        made: Sequence[Turn],
        row: RealArray,
        rest: Any,
        first: int,
        last: int,
        samples: int,
    ) -> RealArray:
        """Run samples first to last - 1, and return the rows (last - first, S) of their signals."""
        names = cascade.signals
        rows, measured = np.empty((last - first, len(names))), row[: self.measurements]
        ends = self.sense_parameters, self.read_parameters
        road = None if cascade.plain else SIMULATION.taken()
        run = plain_loop if road is None else road.fast_loop
        stop = run(made, self.sense, self.read, ends, measured, row, rest, rows, first, last)
        if stop < last:
            name = names[int(np.flatnonzero(~np.isfinite(row))[0])]
            part = next((part.name for part in cascade.parts if name in part.signals), "reading")
            raise InputError(
                f"the {part}'s output {name!r} is not finite at sample {stop} of {samples}, "
                f"{stop * self.dt:.6g} s"
            )
        return rows

    @cached_property
    def _advance(self) -> tuple[RealArray, RealArray, IntegerArray, RealArray, RealArray]:
        """Data of the W steps of a period, each of two halves.

        Holds the matrices from the state at the start of a step (W, 2 q + n, n), and from the input
        (W, 2 q + n, m), to the positions at its middle, those at its end, and the state at its end;
        the age (W,) [samples] of the input that is held, the fraction (2 W,) of the period at the
        end of each half step, and the weights (W, 4) of the filter for each step. The sensor sees
        the middle by its positions alone, so no state is computed there.
        """
        whole, rest = split_delay(self.delay_samples)
        pieces = [(rest, whole + 1), (1.0 - rest, whole)] if rest > 0.0 else [(1.0, whole)]
        transition, drive, age, length, weights = [], [], [], [], []
        to_position = self.plant.C[: self.positions]
        for share, old in pieces:
            step = share / self.refine
            half = np.hstack(held_input_matrices(self.plant.A, self.plant.B, step / 2 * self.dt))
            full = np.hstack(held_input_matrices(self.plant.A, self.plant.B, step * self.dt))
            rows = np.vstack([to_position @ half, to_position @ full, full])
            weight = lowpass_weights(self.corner, step * self.dt)
            for _ in range(self.refine):
                transition.append(rows[:, : self.plant.nstates])
                drive.append(rows[:, self.plant.nstates :])
                age.append(old)
                weights.append(weight)
                length += [step / 2] * 2
        ages, ends = np.array(age, np.int64), np.cumsum(length)
        return np.array(transition), np.array(drive), ages, ends, np.array(weights)


def _checked(name: str, values: ArrayLike, rows: int | None, columns: int | None) -> RealArray:
    """Finite float array (rows, columns), or an InputError; None stands for any size."""
    array = np.ascontiguousarray(values, float)
    wanted = tuple("N" if size is None else size for size in (rows, columns))
    fits = array.ndim == 2 and all(
        size in (None, given) for size, given in zip((rows, columns), array.shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name} has shape {array.shape}; it must be {wanted}")
    with np.errstate(all="ignore"):
        quick = np.isfinite(array.sum())
    if not quick and not np.isfinite(array).all():
        raise InputError(
            f"{name} has values that are not finite, first in row "
            f"{np.flatnonzero(~np.isfinite(array).all(axis=1))[0]}"
        )
    return array
