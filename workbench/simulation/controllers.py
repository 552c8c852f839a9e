"""Sampled controllers: compiled functions with a state that are called once per sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.compiled import kernel
from workbench._core.heavy_types import StateSpace, TransferFunction
from workbench.errors import InputError


@dataclass(frozen=True, eq=False)
class Controller:
    """Any sampled controller, with its logic and memory.

    Unlike a `StateSpace`, it is any compiled function of states and measurements, with logic
    and memory.

    step        compiled function (state, parameters, measurement, output) of float arrays: reads
                the measurement, and updates the state and the output in place; it must not change
                the measurement, which other parts read as well;
    state       initial state (n,); a run works on a copy;
    parameters  all other numbers that the step needs (p,);
    outputs     number of output signals;
    reads       smallest number of measurements; the compiled step does not check it and would read
                beyond the end of a shorter array;
    dt      sampling period [s] that it was made for; None: any;
    carried     number of states, from the first on, that its replacement takes over during a run;
                None: all;
    plain       whether the step is plain Python, which is convenient for trials but makes the loop
                forty times slower.

    Raises InputError if the step is neither compiled nor declared as plain.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.simulation import Controller, play
    >>> def relay(state, parameters, measurement, output):
    ...     output[0] = parameters[0] * np.sign(measurement[0])
    ...
    >>> controller = Controller(relay, np.zeros(0), np.array([2.0]), plain=True)
    >>> play(controller, [[0.1], [-3.0]]).ravel().tolist()
    [2.0, -2.0]
    """

    step: Any
    state: RealArray
    parameters: RealArray
    _: KW_ONLY
    outputs: int = 1
    reads: int = 0
    dt: float | None = None
    carried_states: int | None = None
    plain: bool = False

    def __post_init__(self) -> None:
        if not (self.plain or hasattr(self.step, "compile")):
            raise InputError(
                f"step {self.step!r} is not compiled; decorate it with @kernel, or say "
                "plain=True and wait longer"
            )

    def need_measurements(self, given: int) -> None:
        """Raise InputError if it reads more measurements than are given."""
        if given < self.reads:
            raise InputError(f"the controller reads {self.reads} measurements; there are {given}")


def zero_controller(*, outputs: int = 1) -> Controller:
    """Controller with zero outputs, so that only the excitation acts on the plant: an open loop.

    Examples
    --------
    >>> from workbench.simulation import zero_controller, play
    >>> play(zero_controller(), [[3.0], [4.0]]).ravel().tolist()
    [0.0, 0.0]
    """
    return Controller(_idle, np.zeros(0), np.zeros(0), outputs=outputs)


def linear_controller(
    system: StateSpace | TransferFunction, dt: float, *, measurements: Sequence[int] = (0,)
) -> Controller:
    """Controller from a linear system; a continuous one is discretised by the bilinear transform.

    `measurements` holds the indices of the measurements that are its inputs. Raises InputError if
    their number differs from that of the inputs, or if a discrete system has another `dt` [s].

    Examples
    --------
    >>> import control
    >>> from workbench.simulation import linear_controller, play
    >>> integrator = linear_controller(control.tf([1.0], [1.0, 0.0]), dt=1.0)
    >>> play(integrator, [[1.0]] * 3).ravel().round(6).tolist()
    [0.5, 1.5, 2.5]
    """
    if any(one < 0 for one in measurements):
        raise InputError(f"measurements {measurements}: they are numbered from 0 on")
    if len(measurements) != system.ninputs:
        raise InputError(
            f"{len(measurements)} measurements for a controller of {system.ninputs} inputs"
        )
    system = discrete_system(system, dt)
    sizes = [system.nstates, system.ninputs, system.noutputs]
    matrices = [matrix.ravel() for matrix in (system.A, system.B, system.C, system.D)]
    parameters = np.concatenate([sizes, list(measurements), *matrices])
    # The second half of the state is work space for the next state.
    state = np.zeros(2 * system.nstates)
    reads = max(measurements) + 1
    outputs, n = system.noutputs, system.nstates
    return Controller(
        _linear, state, parameters, outputs=outputs, reads=reads, dt=dt, carried_states=n
    )


def discrete_system(system: StateSpace | TransferFunction, dt: float) -> StateSpace:
    """Discretise a continuous system by the bilinear transform; a discrete one is returned as is.

    Raises InputError if a discrete system has another sampling time than `dt` [s].

    Examples
    --------
    >>> import control
    >>> from workbench.simulation import discrete_system
    >>> K = discrete_system(control.tf([1.0], [1.0, 0.0]), dt=0.2)
    >>> round(float(K.D[0, 0]), 6), K.dt  # the trapezoidal rule
    (0.1, 0.2)
    """
    import control

    if system.isctime():
        system = control.sample_system(control.ss(system), dt, "bilinear")
    elif system.dt is not True and not np.isclose(system.dt, dt, rtol=1e-9, atol=0.0):
        raise InputError(f"the controller has dt = {system.dt} s, the loop dt = {dt} s")
    return control.ss(system)


@kernel
def _idle(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """Step of `zero_controller`."""
    output[:] = 0.0


@kernel
def _linear(
    state: RealArray, parameters: RealArray, measurement: RealArray, output: RealArray
) -> None:
    """Step of `linear_controller`; parameters: n, m, p, indices of inputs, A, B, C, D."""
    n, m, p = int(parameters[0]), int(parameters[1]), int(parameters[2])
    at_a = 3 + m
    at_b = at_a + n * n
    at_c = at_b + n * m
    at_d = at_c + p * n
    for i in range(p):
        total = 0.0
        for j in range(n):
            total += parameters[at_c + i * n + j] * state[j]
        for j in range(m):
            total += parameters[at_d + i * m + j] * measurement[int(parameters[3 + j])]
        output[i] = total
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += parameters[at_a + i * n + j] * state[j]
        for j in range(m):
            total += parameters[at_b + i * m + j] * measurement[int(parameters[3 + j])]
        state[n + i] = total
    for i in range(n):
        state[i] = state[n + i]
