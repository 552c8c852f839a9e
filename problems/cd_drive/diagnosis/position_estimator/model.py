"""Model of a drive in the position estimators, and their inputs (section 7.2.2).

With the error of the lens e = x_cd - x, and u_p the control that would make the lens follow the
disc (figure 7.9), the actuator gives -e = ACT (u - u_p) and the photo diodes with their filter f_en
= K_optn w_a / (s + w_a) e + n. So the oscillators act at the actuator's input, in volts; n is noise
of 0.15 um up to 1750 Hz (eq. 7.31). x itself cannot be seen in f_en: it is the actuator's response
to u, computed in parallel. Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant
Control of CD-players (2003).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from workbench.diagnosis import (
    DisturbedPlant,
    Estimator,
    KalmanEstimator,
    Noise,
    Rotation,
    observer_gain,
    placed_estimator,
    prototype_poles,
)
from workbench.simulation import held_input_matrices, sampled_model
from workbench.types import RealArray, StateSpace

from ...drive.actuator import specific_model
from ...drive.plants import ANTIALIASING, nominal_parameters, plant, total_gain
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import NOISE, PERIOD, coil_gain, find_drive

Prototype = Literal["itae", "bessel"]

FAST_BANDWIDTH = 5000.0
"""Bandwidth of the observer in section 7.3.3 [Hz]."""
SLOW_BANDWIDTH = 300.0
"""Bandwidth of an observer that must bridge a defect [Hz]: below the loop's crossover, and below
the bandwidth of the noise.
"""
OSCILLATOR_DECAY = 60.0
"""Rate at which placed oscillators settle [1/s]: in a tenth of a revolution."""
PRINTED_K_OBS = 1e8 * np.array([4.9312, 4.0959, 3.2174, 2.3024, 1.3581])
"""Gain of the observer as printed in equation 7.34."""
PRINTED_K_P = np.array([45.0, 45.0])
"""Gain of the oscillators as printed in equation 7.35."""
CONTROL_NOISE = 0.05
"""White uncertainty of u [V rms] in the Kalman filter: a sixtieth of the control for the largest
wobble, since no drive equals the nominal one.
"""
OSCILLATOR_STEP = 3e-4
"""Random step of the oscillators [V rms per sample]: in a revolution a hundredth of the control for
the wobble.
"""
CONVERTER_NOISE = 1e-3
"""White part of the noise of f_en [units rms]: the converter's step."""


def model(axis: Axis, rotation: Rotation, coloured: bool) -> DisturbedPlant:
    """Model of the nominal drive: u, u_p -> f_en [units], e [m], and in parallel u -> x [m].

    u acts from one sample to the next; if the computer needs one sample, u is the previous one.
    """
    import control

    drive = find_drive(axis, "nominal")
    lens, gain = specific_model(drive).state_space(), coil_gain(drive)
    n = lens.nstates
    a, b, c = np.zeros((n + 1, n + 1)), np.zeros((n + 1, 2)), np.zeros((2, n + 1))
    a[:n, :n] = lens.A  # sign of -e
    a[n, :n] = -ANTIALIASING * drive.K_optn * lens.C[0]
    a[n, n] = -ANTIALIASING
    b[:n] = gain * lens.B * [1.0, -1.0]
    c[0, n], c[1, :n] = 1.0, -lens.C[0]
    return DisturbedPlant(
        sampled_model(control.ss(a, b, c, 0.0), PERIOD),
        rotation,
        colour=colour(axis) if coloured else None,
        unmeasured=sampled_model(gain * lens, PERIOD),
    )


def colour(axis: Axis, band: float = 1750.0) -> StateSpace:
    """Low-pass of order 2 from white noise of variance 1 to noise of f_en of the laboratory's size.

    It has Butterworth's poles up to `band` [Hz]; its sampled output has the noise's variance.
    """
    import control

    omega = 2 * np.pi * band
    transition, _ = held_input_matrices(
        [[0.0, 1.0], [-(omega**2), -(2**0.5) * omega]], np.zeros((2, 1)), PERIOD
    )
    drive = np.array([[0.0], [1.0]])
    variance = solve_discrete_lyapunov(transition, drive @ drive.T)[0, 0]
    size = NOISE[axis] * find_drive(axis, "nominal").K_optn
    return control.ss(transition, drive * size / variance**0.5, [[1.0, 0.0]], 0.0, PERIOD)


def itae(axis: Axis, rotation: Rotation, bandwidth: float) -> Estimator:
    """Estimator with ITAE poles for actuator and filter, and with oscillators that settle.

    bandwidth: of the ITAE poles [Hz].
    """
    return of_prototype("itae", axis, rotation, bandwidth)


def of_prototype(kind: Prototype, axis: Axis, rotation: Rotation, bandwidth: float) -> Estimator:
    """As `itae`, with the poles of a prototype filter, "itae" or "bessel"."""
    poles = np.exp(prototype_poles(kind, 5, 2 * np.pi * bandwidth) * PERIOD)
    together = np.concatenate([poles, rotation.poles(PERIOD, OSCILLATOR_DECAY)])
    return placed_estimator(model(axis, rotation, coloured=False), together)


def thesis_estimator(axis: Axis, rotation: Rotation) -> Estimator:
    """Estimator of the thesis: K_obs for actuator and filter alone (eq. 7.33), K_p of eq. 7.35.

    The thesis does not state by what K_p is multiplied. If it applies per sample, and the
    oscillator's second state has the other sign, the oscillator settles at 44 per second in focus;
    if it applies per second, at a thousandth of that. With the sign of this oscillator the
    estimator is unstable.
    """
    believed = model(axis, rotation, coloured=False)
    poles = np.exp(prototype_poles("itae", 5, 2 * np.pi * FAST_BANDWIDTH) * PERIOD)
    K_obs = observer_gain(believed.plant.A, believed.plant.C[:1], poles, dt=PERIOD)[:, 0]
    L = np.concatenate([K_obs, PRINTED_K_P * [1.0, -1.0]])
    n = believed.seen
    return Estimator(believed, np.linalg.solve(believed.A[:n, :n], L))


def kalman(axis: Axis, rotation: Rotation) -> KalmanEstimator:
    """Kalman filter of actuator, filter, oscillators and coloured noise.

    Its white measurement noise is increased in a defect.
    """
    defect = ACCEPTABLE_ERROR[axis] * find_drive(axis, "nominal").K_optn
    return KalmanEstimator(
        model(axis, rotation, coloured=True),
        Noise(CONTROL_NOISE, OSCILLATOR_STEP, CONVERTER_NOISE, defect),
    )


def companion_gain(axis: Axis) -> RealArray:
    """Gain K_obs (5,) of the controllable companion form of eq. 3.18 held at 35 kHz (7.34)."""
    system = sampled_model(plant(nominal_parameters(axis), total_gain(axis)), PERIOD)
    poles = np.exp(prototype_poles("itae", 5, 2 * np.pi * FAST_BANDWIDTH) * PERIOD)
    gain = observer_gain(system.A, system.C, poles, dt=PERIOD)[:, 0]
    form = companion(np.asarray(np.poly(system.A), float))
    there, here = (_reachable(A, B) for A, B in (form, (system.A, system.B)))
    size = abs(here).max(axis=1, keepdims=True)
    transformed: RealArray = there @ np.linalg.solve(here / size, gain / size[:, 0])
    return transformed


def companion(denominator: RealArray) -> tuple[RealArray, RealArray]:
    """State and input matrix of the controllable companion form of a monic polynomial."""
    n = len(denominator) - 1
    return np.vstack([-denominator[1:], np.eye(n)[:-1]]), np.eye(n)[:, :1]


def _reachable(A: RealArray, B: RealArray) -> RealArray:
    columns = [B]
    for _ in range(len(A) - 1):
        columns.append(A @ columns[-1])
    return np.hstack(columns)
