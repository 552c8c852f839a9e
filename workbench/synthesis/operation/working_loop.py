"""The loop around its working point, on each measured plant, as a Study."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure, StateSpace
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.executor import Context
from workbench.figures.panels import MOST_NAMES
from workbench.input_checks import need_kind, need_positive
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.synthesis.demands.demands import SETTLED
from workbench.synthesis.implementation.board_loop import BoardLoop
from workbench.synthesis.implementation.c_code.c_state_space import start_gains
from workbench.synthesis.implementation.program import Implementation
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.synthesis.implementation.working_point.constant_signals import ConstantSignals
from workbench.synthesis.implementation.working_point.point import WorkingPoint
from workbench.synthesis.operation.loop_in_time import loop_in_time
from workbench.synthesis.operation.measured_loops import (
    loops_around,
    measured_models,
    samples_to_settle,
)
from workbench.uncertainty import Responses

REST_SHARE = 0.05
"""Share of a phase at its start during which the loop is at rest."""
STEP_SHARE, DISTURBANCE_SHARE = 0.3, 0.1
"""Step of the set-point relative to the slowest oscillation that the limits allow, and disturbance
relative to the range of the limits.
"""
BUMP = 1e-6
"""Largest change of the control before the step that counts as rounding, relative to its change by
the step.
"""
LEFT = 0.01
"""Largest error at the end of a step with integral action, relative to the step, for a settled
loop.
"""


@dataclass(frozen=True, eq=False)
class WorkingLoop(Study):
    """A loop around its working point: from rest, a step of the set-point, then a step at the
    input.

    Every measured plant is simulated by a model fitted to its response, with the limits of the
    control, hold and delay, and the controller as it is exported. The implementation gives the
    limits and the working point. For the corners of a stated spread real plants of its disc are
    taken: the measured one times a number plus an all-pass, in the corner's direction at the
    crossover frequency.

    Parameters
    ----------
    responses
        Responses of the measured plants.
    board
        The Run or Solution of a certified `Implementation`.
    step
        Step of the set-point [units of y]; None for a part of the oscillation that the limits allow
        at the lowest measured frequency.
    disturbance
        Signal added to the control in the second half [units of u]; None for a tenth of the limits'
        range.
    noise
        Standard deviation of the measurement's noise [units of y].
    seed
        Seed of the noise.

    Raises
    ------
    InputError
        The implementation has no working point or more than one channel; a step is zero.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.synthesis import Implementation, WorkingLoop, WorkingPoint
    >>> from workbench.uncertainty import CircleCover, Responses
    >>> omega = np.geomspace(0.01, 10, 60)
    >>> values = np.array([gain / (1j * omega + 1) for gain in (0.9, 1.0, 1.1)]).T
    >>> plants = Responses(omega=omega, values=values)
    >>> cover = wb.solve(CircleCover(plants, order=1))
    >>> point = WorkingPoint(50.0, 20.0, u_unit="%", y_unit="K")
    >>> given = {"limits": (0.0, 100.0), "working_point": point}
    >>> K = control.tf([2.0, 1.0], [1.0, 0.0])
    >>> board = wb.solve(Implementation(cover, K, dt=0.05, **given))
    >>> loop = wb.solve(WorkingLoop(plants, board, step=2.0))
    >>> loop.certificate.holds, loop.metrics["static_error"] < 1e-4
    (True, True)
    """

    responses: Responses
    board: Any
    step: float | None = field(default=None, kw_only=True)
    disturbance: float | None = field(default=None, kw_only=True)
    noise: float = field(default=0.0, kw_only=True)
    seed: int = field(default=0, kw_only=True)

    headline: ClassVar[str] = "static_error"

    def __post_init__(self) -> None:
        need_kind(self.responses, Responses, "responses")
        task = getattr(self.board, "task", None)
        if not isinstance(task, Implementation) or self.board.answer is None:
            raise InputError(f"board is {self.board!r}; an Implementation with an answer is needed")
        if task.working_point is None or (task.controller.ninputs, task.controller.noutputs) != (
            1,
            1,
        ):
            raise InputError("the implementation needs a working point, one input and one output")
        for name in ("step", "disturbance"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value):
                raise InputError(f"{name} is {value!r}; a number other than zero is needed")
        if self.noise:
            need_positive(self.noise, "noise")

    # --- what the loop is -------------------------------------------------------------------------

    @property
    def task(self) -> Implementation:
        """The `Implementation` that was answered."""
        found: Implementation = self.board.task
        return found

    @property
    def actuator(self) -> Actuator:
        """Limits of the actuator and its working point."""
        assert self.task.actuator is not None
        return self.task.actuator

    @property
    def point(self) -> WorkingPoint:
        """Working point of the implementation."""
        assert self.actuator.point is not None
        return self.actuator.point

    @property
    def constant(self) -> ConstantSignals | None:
        """Effect of constant signals on every plant of the set."""
        return self.task.constant_signals(self.board.answer)

    @part
    def models(self, context: Context) -> tuple[list[StateSpace], RealArray]:
        """A continuous model of each plant, and the relative error of each model."""
        return measured_models(self.responses, self.task, self.board.answer.K, context)

    @part
    def loops(self, models: Any) -> list[BoardLoop]:
        """The sampled loop of each plant."""
        return loops_around(models[0], self.task)

    @part
    def samples(self, loops: Any) -> int:
        """Number of samples of a phase, long enough for the loop's slowest motion to decay."""
        K = self.board.answer.K
        poles = np.concatenate([np.abs(one.loop_of(K).closed().poles()) for one in loops])
        filtered = 0.0 if self.actuator.approach is None else 1.0 - self.actuator.approach[0]
        return samples_to_settle(max(float(poles.max()), filtered))

    @part
    def sizes(self) -> tuple[float, float]:
        """The step of the set-point and the disturbance.

        The limits allow an oscillation of a certain size at the lowest frequency at which a plant
        was measured. A static gain would be extrapolated, and endless for an integrating plant.
        """
        limits = self.actuator.deviations
        low, high = (-1.0, 1.0) if limits is None else (float(limits[0][0]), float(limits[1][0]))
        there, size = self.responses.present, np.abs(self.responses.values)
        lowest = size[there.argmax(axis=0), np.arange(size.shape[1])]
        step = STEP_SHARE * high * float(lowest.min()) if self.step is None else self.step
        disturbance = DISTURBANCE_SHARE * (high - low)
        return step, -disturbance if self.disturbance is None else self.disturbance

    # --- arrays -----------------------------------------------------------------------------------

    plant = dim(lambda self: list(self.responses.plants), meaning="measured plant")
    time = dim(
        lambda self, samples: np.arange(2 * samples) * self.task.dt,
        unit="s",
        meaning="time from rest",
    )
    signal = dim("y", "u")

    @array(dims=(time,), unit="1", meaning="set-point, in units of the measurement")
    def setpoint(self, samples: Any, sizes: Any) -> RealArray:
        rest = int(REST_SHARE * samples)
        return self.point.y[0] + sizes[0] * (np.arange(2 * samples) >= rest)

    @array(
        dims=(plant, signal, time),
        unit="1",
        meaning="measurement and control, absolute, in their units",
    )
    def signals(self, samples: Any, sizes: Any, loops: Any, setpoint: Any) -> RealArray:
        K, rng = self.board.answer.K, np.random.default_rng(self.seed)
        disturbance = sizes[1] * (np.arange(2 * samples) >= samples)
        return np.array([
            loop_in_time(
                one.loop_of(K).held(),
                K,
                self.actuator,
                np.asarray(setpoint),
                disturbance,
                self.noise * rng.standard_normal(2 * samples),
            )
            for one in loops
        ])  # fmt: skip

    @array(
        dims=(plant,), unit="1", meaning="relative rms error of the model that stands for the plant"
    )
    def model_error(self, models: Any) -> RealArray:
        return models[1]

    @array(dims=(), unit="1", meaning="step of the set-point, in units of the measurement")
    def step_size(self, sizes: Any) -> float:
        return sizes[0]

    # --- what it says -----------------------------------------------------------------------------

    @check(title="limits", statement="largest violation of a limit by a control", at_most=0.0)
    def kept(self, signals: DataArray) -> float:
        u = signals.sel(signal="u").values
        if self.actuator.lowest is None or self.actuator.highest is None:
            return 0.0
        return float(max(self.actuator.lowest[0] - u.min(), u.max() - self.actuator.highest[0], 0))

    @check(
        title="no bump",
        statement="largest change of a control at rest, over its largest change",
        at_most=BUMP,
    )
    def smooth(self, signals: DataArray, setpoint: DataArray) -> float:
        if self.noise:
            return 0.0
        u = signals.sel(signal="u").values - self.point.u[0]
        rest = setpoint.values == setpoint.values[0]
        return float(np.abs(u[:, rest]).max() / max(float(np.abs(u).max()), 1e-300))

    @check(
        title="error at the end",
        statement="error at the end of the step, over the step, less what constant signals leave",
        at_most=LEFT,
    )
    def settled(self, signals: DataArray, step_size: DataArray) -> float:
        left = float(self._remaining_error(signals, step_size).max())
        return left - (0.0 if self.constant is None else self.constant.error)

    def second_opinion(self, answer: Dataset) -> list[Check]:
        """Compute the controls by the controller's difference equation, until a limit is met."""
        K, act = self.board.answer.K, self.actuator
        assert act.point is not None
        apart = 0.0
        for one in answer["signals"].values:
            y, u = one
            error = act.sign * (y - _filtered(answer["setpoint"].values, self.task, y[0]))
            wanted = act.point.u[0] + _by_difference_equation(K, error)
            met = np.zeros(u.size, bool)
            if act.lowest is not None and act.highest is not None:
                met |= (u <= act.lowest[0]) | (u >= act.highest[0])
            if act.step is not None:
                change = np.abs(np.diff(u, prepend=act.point.u[0]))
                met |= change >= act.step[0] * (1 - 1e-9)
            until = int(np.argmax(met)) if met.any() else u.size
            size = max(float(np.ptp(u)), 1e-300)
            apart = max(apart, float(np.abs(u[:until] - wanted[:until]).max(initial=0.0)) / size)
        statement = "largest difference of a control from the controller's difference equation"
        over = "for each plant, until a limit is met"
        return [
            *super().second_opinion(answer),
            Check("controls", statement, apart, 1e-4, over=over),
        ]

    @metric
    def static_error(self, signals: DataArray, step_size: DataArray) -> float:
        return float(self._remaining_error(signals, step_size).max())

    @metric
    def overshoot(self, signals: DataArray, step_size: DataArray) -> float:
        return float(self._step_quality(signals, step_size)[0].max())

    @metric
    def settling_s(self, signals: DataArray, step_size: DataArray) -> float:
        return float(self._step_quality(signals, step_size)[1].max())

    def _remaining_error(self, signals: DataArray, step_size: DataArray) -> RealArray:
        """Error at the end of the step relative to the step, for each plant."""
        y = signals.sel(signal="y").values
        half = y.shape[1] // 2
        last = y[:, half - max(half // 20, 1) : half].mean(axis=1)
        wanted = self.point.y[0] + float(step_size)
        left: RealArray = np.abs(last - wanted) / abs(float(step_size))
        return left

    def _step_quality(
        self, signals: DataArray, step_size: DataArray
    ) -> tuple[RealArray, RealArray]:
        """Overshoot relative to the step, and settling time [s], for each plant."""
        half = signals.sizes["time"] // 2
        rest = int(REST_SHARE * half)
        y = signals.sel(signal="y").values[:, rest:half]
        share = (y - self.point.y[0]) / float(step_size)
        outside = np.abs(share - 1) > SETTLED
        last = np.where(outside.any(axis=1), half - rest - np.argmax(outside[:, ::-1], axis=1), 0)
        return np.maximum(share.max(axis=1) - 1, 0.0), last * self.task.dt

    @table
    def constant_signals(self) -> str:
        constant = self.constant
        if constant is None:
            return "Constant signals: not known, since not every plant of the set is stabilised.\n"
        words = constant.words(self.point.y_unit)
        return f"{words[0].upper()}{words[1:]}.\n"

    @table
    def plants(self, signals: DataArray, step_size: DataArray, model_error: DataArray) -> Any:
        heads = ["plant", "overshoot", "settles within [s]", "error at the end", "model's error"]
        over, settling = self._step_quality(signals, step_size)
        left = self._remaining_error(signals, step_size)
        columns = (self.responses.plants, over, settling, left, model_error.values)
        rows = [
            [name, f"{one:.1%}", f"{time:.4g}", f"{end:.2%}", f"{own:.1%}"]
            for name, one, time, end, own in zip(*columns, strict=True)
        ]
        return heads, rows

    @figure
    def working_point(self, signals: DataArray, setpoint: DataArray) -> Mapping[str, Figure]:
        drawn, (top, bottom) = figures.axes(2, 1, size=(7.2, 5.4), sharex=True)
        time, many = signals["time"].values, signals.sizes["plant"] > MOST_NAMES
        for k, name in enumerate(signals["plant"].values):
            look: dict[str, Any] = {"color": "0.6", "linewidth": 0.7} if many else {}
            one = signals.sel(plant=name)
            top.plot(time, one.sel(signal="y"), label=None if many and k else str(name), **look)
            bottom.step(time, one.sel(signal="u"), where="post", **look)
        top.plot(time, setpoint, color=figures.BLACK, linestyle="--", label="set-point")
        if self.actuator.approach is not None:
            passed = self.actuator.filtered(setpoint.values, setpoint.values[0])
            top.plot(time, passed, color=figures.BLACK, linestyle=":", label="filtered set-point")
        low, high = self.actuator.lowest, self.actuator.highest
        if low is not None and high is not None:
            for level in (low[0], high[0]):
                bottom.axhline(level, color=figures.ORANGE, linestyle=":")
        figures.label(top, y=_axis("measurement", self.point.y_unit))
        figures.label(bottom, x="time [s]", y=_axis("control", self.point.u_unit))
        figures.legend_below(drawn, top)
        return {"working-point": drawn}


def _axis(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} [{unit}]"


def _filtered(setpoint: RealArray, task: Implementation, first: float) -> RealArray:
    """The set-point (samples,) after the filter's difference equation, which starts at `first`."""
    if task.setpoint_filter is None:
        return setpoint
    from scipy.signal import lfilter

    decay = math.exp(-task.dt / float(np.ravel(task.setpoint_filter)[0]))
    found: RealArray = lfilter([0.0, 1 - decay], [1.0, -decay], setpoint, zi=[first])[0]
    return found


def _by_difference_equation(K: StateSpace, error: RealArray) -> RealArray:
    """The controller's output (samples,) for given errors, from a start without a bump."""
    from scipy.signal import lfilter, lfiltic, ss2tf

    b, a = ss2tf(K.A, K.B, K.C, K.D)
    if not error[0]:
        found: RealArray = lfilter(b[0], a, error)
        return found
    # The controller starts from rest at the first error, which gives its initial state.
    x, first = start_gains(K)[0][:, 0] * error[0], []
    for one in error[: len(a) - 1]:
        first.append(float(K.C[0] @ x + K.D[0, 0] * one))
        x = K.A @ x + K.B[:, 0] * one
    count = len(first)
    past = lfiltic(b[0], a, first[::-1], error[:count][::-1])
    found = np.append(first, lfilter(b[0], a, error[count:], zi=past)[0])
    return found
