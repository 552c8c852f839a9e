"""Speed up to which the focus surely stays in the linear range, and speed above which it surely
leaves the s-curve.

Both are relative speeds of a lens that passes the layer at constant speed, without noise. Below the
first, the loop is linear during the whole braking, so its error is proportional to the speed. Above
the second, no voltage within the converter's limits stops the lens before the end of the s-curve.
"""

from __future__ import annotations

import math

import numpy as np

from workbench.simulation import discrete_system, held_input_matrices

from ...drive.actuator import SERIES_RESISTANCE, specific_model
from ...drive.photo_diodes import S_CURVE_LINEAR, S_CURVE_PEAK
from ...drive.plants import ANTIALIASING, controller
from ...drive.tables import red_book
from ...laboratory.bench_setup import OUTPUT_LIMIT, PERIOD, coil_gain, find_drive

FINER = 8
"""Number of steps per sample in which the error is evaluated."""
SAMPLES = 700
"""Number of samples after the loop is closed: 20 ms, in which the nominal loop settles to 1e-3."""
DELAY = 1
"""Delay of the laboratory [samples]."""


def linear_overshoot(drive: str) -> float:
    """Largest error after closing, over the relative speed [s], while the loop is linear.

    The lens arrives in a steady ramp, whose voltage is held when the loop is closed. It is closed
    at the first sample whose filtered error is past zero, at most one sample late. The error is
    linear in this delay, so its largest value is at one end of it.
    """
    return max(_overshoot(drive, late) for late in (0.0, PERIOD))


def held_speed(drive: str) -> float:
    """Relative speed [m/s] up to which the error stays in the linear range."""
    return S_CURVE_LINEAR / linear_overshoot(drive)


def escape_speed(drive: str, place: float) -> float:
    """Relative speed [m/s] above which the lens leaves the s-curve under any voltage.

    place: largest distance [m] of the layer from the rest of the lens. All force is taken to act on
    the mass of the lens side alone, and the layer to move towards the lens with the Red Book's full
    acceleration.
    """
    p = find_drive("focus", drive)
    emf = p.Bl**2 / (p.R + SERIES_RESISTANCE)
    coil = p.Bl * coil_gain(p) * OUTPUT_LIMIT / (p.R + SERIES_RESISTANCE)
    braking = (coil + p.k * place) / p.m1 + red_book("focus").acceleration
    # v^2 / 2 = (braking + damping v) d, solved for v; the damping is that at the entering speed
    damped = (emf + p.b1 + p.b2) / p.m1 * S_CURVE_PEAK
    return damped + math.sqrt(damped**2 + 2 * braking * S_CURVE_PEAK)


def _overshoot(drive: str, late: float) -> float:
    """Largest error over the speed [s] if the loop is closed `late` [s] after the error's zero
    crossing.
    """
    model = find_drive("focus", drive)
    moving = specific_model(model).state_space()
    A, B = moving.A, moving.B * coil_gain(model)
    rising = 1.0 / float(-(moving.C @ np.linalg.solve(A, B))[0, 0])
    z1 = -np.linalg.solve(A, B[:, 0] * rising)  # steady ramp: z = z0 + z1 t, x = t
    z0 = np.linalg.solve(A, z1)
    ahead = float((moving.C @ z0)[0])
    passed = late + 1.0 / ANTIALIASING
    z, volts = z0 + z1 * (passed - ahead), rising * (passed - ahead)
    n = len(A)
    a = np.zeros((n + 1, n + 1))
    a[:n, :n], a[n, :n], a[n, n] = A, -ANTIALIASING * model.K_optn * moving.C[0], -ANTIALIASING
    b = np.vstack([B, [[0.0]]])
    step, push = held_input_matrices(a, b, PERIOD / FINER)
    state = np.append(z, -model.K_optn * late)
    K = discrete_system(controller("focus"), PERIOD)
    memory, queue, worst = np.zeros(K.nstates), [volts] * DELAY, 0.0
    for _ in range(SAMPLES):
        error = state[n]
        queue.append(volts + float((K.C @ memory)[0] + K.D[0, 0] * error))
        memory = K.A @ memory + K.B[:, 0] * error
        applied = queue.pop(0)
        for _ in range(FINER):
            worst = max(worst, abs(float((moving.C @ state[:n])[0])))
            state = step @ state + push[:, 0] * applied
    return worst
