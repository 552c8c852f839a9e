"""Simulation of a controller's code and a linear plant around a working point, sample by sample."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.synthesis.implementation.c_code.c_state_space import anti_windup_gain, start_gains
from workbench.synthesis.implementation.working_point.actuator import Actuator


def loop_in_time(
    plant: StateSpace,
    controller: StateSpace,
    actuator: Actuator,
    setpoint: RealArray,
    disturbance: RealArray,
    noise: RealArray,
) -> tuple[RealArray, RealArray]:
    """Absolute measurements and controls (samples,), starting from rest at the working point.

    Parameters
    ----------
    plant
        Sampled plant with hold and delay, strictly proper, from deviations of the control to
        deviations of the measurement.
    controller
        Sampled controller with one input and one output. It starts as the C code does, without a
        bump.
    actuator
        Limits and largest rate of the control, the working point, and the filter of the set-point.
    setpoint, disturbance, noise
        Absolute set-points, signal added to the control, and signal added to the measurement
        (samples,).
    """
    assert actuator.point is not None
    (rest,), (own,) = actuator.point.u, actuator.point.y
    K, sign = controller, actuator.sign
    setpoint = actuator.filtered(setpoint, own + noise[0])
    H = anti_windup_gain(K)[:, 0] if actuator.bounded else np.zeros(K.nstates)
    inward, outward = np.asarray(K.B)[:, 0], np.asarray(K.C)[0]
    into, out = np.asarray(plant.B)[:, 0], np.asarray(plant.C)[0]
    from_error, _ = start_gains(K)
    state = from_error[:, 0] * (sign * (own + noise[0] - setpoint[0]))
    x, before = np.zeros(plant.nstates), np.array([rest])
    y, u = np.empty(setpoint.size), np.empty(setpoint.size)
    for k in range(setpoint.size):
        y[k] = own + out @ x + noise[k]
        error = sign * (y[k] - setpoint[k])
        wanted = rest + outward @ state + K.D[0, 0] * error
        before = actuator.within(np.array([wanted]), before)
        u[k] = before[0]
        state = K.A @ state + inward * error + H * (u[k] - wanted)
        x = plant.A @ x + into * (u[k] - rest + disturbance[k])
    return y, u
