"""A controller's code about its working point, around a linear plant, sample by sample."""

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
    """Measurements and controls (samples,), absolute, from rest at the working point.

    Parameters
    ----------
    plant
        Sampled, strictly proper, from deviations of the control to those of the measurement, with
        hold and delay.
    controller
        Sampled, of one input and one output. It starts as the C code does, without a bump.
    actuator
        Limits and rate, and a working point.
    setpoint, disturbance, noise
        Absolute set-points, what is added to the control, and to the measurement (samples,).
    """
    assert actuator.point is not None
    (rest,), (own,) = actuator.point.u, actuator.point.y
    K, sign = controller, actuator.sign
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
