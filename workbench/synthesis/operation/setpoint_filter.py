"""The time constant of a set-point filter, from the overshoot that is demanded.

A stable loop around a plant with a pole p > 0 has S(p) = 0. So after a step of the set-point the
integral of e(t) exp(-p t) over the error e is zero, e changes its sign, and the loop overshoots,
the more the slower it is (R. H. Middleton, Trade-offs in linear control system design, Automatica
27 (1991) 281-292). A filter of the set-point, outside the loop, changes the response to set-points
alone (K. J. Astrom, R. M. Murray, Feedback Systems, 2nd ed., Princeton 2021, chapter 12: two
degrees of freedom).

A filter with the time constant T2 > T1 is that with T1 followed by (T1 s + 1) / (T2 s + 1), whose
impulse response is nowhere negative and has the integral 1. So a longer time constant never raises
the largest value of a step response, and the shortest one that is long enough is found by
bisection.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from typing import get_args

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import need_kind
from workbench.solvers import Options
from workbench.synthesis.demands.demands import SETTLED, Demands
from workbench.synthesis.implementation.discretise import ImplementationMethod
from workbench.synthesis.implementation.program import Implementation
from workbench.synthesis.implementation.working_point.actuator import SLOWEST_FILTER
from workbench.synthesis.operation.measured_loops import (
    loops_around,
    measured_models,
    samples_to_settle,
)
from workbench.uncertainty import Responses

RATIO = 1.02
"""Ratio of neighbouring time constants that are tried."""


def setpoint_time_constant(
    responses: Responses, implementation: Implementation, overshoot: float | None
) -> float | None:
    """Shortest time constant [s] of a set-point filter that limits the overshoot of every plant.

    Every measured plant is simulated by a model fitted to its response, in the sampled loop without
    limits, with each way to discretise the controller. The filter is 1 / (T s + 1), with T from the
    sampling time on in steps of 2 %. It is outside the loop, so it changes neither stability nor
    what is proven of the loop.

    Parameters
    ----------
    responses
        Responses of the measured plants.
    implementation
        An `Implementation` of a controller with one input and one output; its own filter does not
        count.
    overshoot
        Largest overshoot after a step of the set-point, relative to the step. 0 stands for no
        overshoot above the 2 % within which a loop has settled. None: any.

    Returns
    -------
    float | None
        None if no filter is needed.

    Raises
    ------
    InputError
        The overshoot is no share of a step; the controller has several channels; the loop is
        unstable around a measured plant; or no filter up to 1e5 samples is slow enough.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import Implementation, setpoint_time_constant
    >>> from workbench.uncertainty import Responses
    >>> omega = np.geomspace(0.01, 10, 60)
    >>> values = np.array([gain / (1j * omega - 0.5) for gain in (0.9, 1.0, 1.1)]).T
    >>> plants, G = Responses(omega=omega, values=values), control.tf([1.0], [1.0, -0.5])
    >>> task = Implementation(G, control.tf([2.0, 1.0], [1.0, 0.0]), dt=0.05)
    >>> 0.5 < setpoint_time_constant(plants, task, 0.1) < 2.0
    True
    >>> setpoint_time_constant(plants, task, 0.9) is None
    True
    """
    need_kind(responses, Responses, "responses")
    need_kind(implementation, Implementation, "implementation")
    Demands(overshoot=overshoot)  # raises for an invalid number
    K = implementation.controller
    if (K.ninputs, K.noutputs) != (1, 1):
        raise InputError(
            f"the controller has {K.ninputs} inputs and {K.noutputs} outputs; one of each is needed"
        )
    if overshoot is None:
        return None
    most, dt = 1.0 + (overshoot or SETTLED), implementation.dt
    steps = _steps(responses, implementation)

    def enough(power: int) -> bool:
        return _peak(steps, dt * RATIO**power, dt) <= most

    if max(float(step.max()) for step in steps) <= most:
        return None
    powers = range(math.floor(math.log(SLOWEST_FILTER, RATIO)) + 1)
    found = bisect_left(powers, True, key=enough)
    if found == len(powers):
        raise InputError(
            f"no filter of the set-point up to {SLOWEST_FILTER * dt:g} s keeps an overshoot of "
            f"{overshoot:g}"
        )
    return float(dt * RATIO**found)


def _steps(responses: Responses, task: Implementation) -> list[RealArray]:
    """Step responses (samples,) to the set-point of the loop around every measured plant, with each
    way of discretisation for which all loops are stable.
    """
    sampled = [task.coefficients(way).K for way in get_args(ImplementationMethod)]
    models, _ = measured_models(responses, task, sampled[0], Context(options=Options()))
    loops, unstable = loops_around(models, task), dict[str, None]()
    steps = []
    for K in sampled:
        every = [loop.sensitivity(K) for loop in loops]
        slowest = [float(np.abs(one.poles()).max(initial=0.0)) for one in every]
        if max(slowest) >= 1.0:
            unstable[str(responses.plants[int(np.argmax(slowest))])] = None
            continue
        steps += [_step(S, samples_to_settle(pole)) for S, pole in zip(every, slowest, strict=True)]
    if not steps:
        raise InputError(
            f"the sampled loop is unstable around {', '.join(unstable)}: no filter of the "
            "set-point helps"
        )
    return steps


def _step(S: StateSpace, samples: int) -> RealArray:
    """Step response (samples,) of 1 - S, for a sensitivity S."""
    x, found = np.zeros(S.nstates), np.empty(samples)
    A, B, C = np.asarray(S.A), np.asarray(S.B)[:, 0], np.asarray(S.C)[0]
    for k in range(samples):
        found[k] = C @ x
        x = A @ x + B
    return 1.0 - S.D[0, 0] - found


def _peak(steps: list[RealArray], time_constant: float, dt: float) -> float:
    """Largest value of the step responses behind a filter of the set-point."""
    from scipy.signal import lfilter

    decay = math.exp(-dt / time_constant)
    return max(float(lfilter([0.0, 1 - decay], [1.0, -decay], step).max()) for step in steps)
