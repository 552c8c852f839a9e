"""Plants in closed loops whose truth is known: a lag with dead time under PI, a resonance under
LQG; each driven at its set-point, with a disturbance of slow noise at its output."""

from __future__ import annotations

from functools import cache

import control
import numpy as np
from scipy.signal import lfilter

CORRELATED = 0.9
"""Correlation of the disturbance from sample to sample."""


@cache
def lag_under_pi():
    """1 / (20 s + 1) with a dead time of 4 s, sampled every second, and its PI controller."""
    pole = np.exp(-1 / 20)
    plant = control.tf([1 - pole], np.r_[1, -pole, np.zeros(4)], 1.0)
    return control.ss(plant), control.ss(control.tf([1.5 * (1 + 1 / 20), -1.5], [1, -1], 1.0))


@cache
def resonance_under_lqg():
    """A mode of damping 0.02, and the controller of its regulator and its observer."""
    mode = control.ss(control.tf([0.36], [1, 0.024, 0.36]))
    plant = control.sample_system(mode, 1.0, "zoh")
    gain, _, _ = control.dlqr(plant, plant.C.T @ plant.C, 0.3 * np.eye(1))
    observer, _, _ = control.dlqe(plant.A, np.eye(2), plant.C, 0.05 * np.eye(2), np.eye(1))
    inward = plant.A @ observer
    inner = plant.A - plant.B @ gain - inward @ plant.C
    return plant, control.ss(inner, inward, gain, 0, 1.0)


LOOPS = {"lag": lag_under_pi, "resonance": resonance_under_lqg}


def steps(rng, samples, records):
    """Set-points that change every 100 samples."""
    levels = rng.standard_normal((-(-samples // 100), records))
    return np.repeat(levels, 100, axis=0)[:samples]


def binary(rng, samples, records):
    """Pseudo-random binary signals that may change every fifth sample."""
    levels = rng.choice([-1.0, 1.0], (-(-samples // 5), records))
    return np.repeat(levels, 5, axis=0)[:samples]


def periodic(rng, samples, records):
    """Pseudo-random binary signals of 256 samples, repeated."""
    return np.tile(rng.choice([-1.0, 1.0], (256, records)), (samples // 256 + 1, 1))[:samples]


EXCITATIONS = {"steps": steps, "binary": binary, "periodic": periodic}


POLES = np.exp(-1 / np.array([[20.0, 12.0], [8.0, 15.0]]))
GAINS = np.array([[1.0, 0.5], [-0.4, 1.2]])


def two_by_two_response(frequency):
    """Response (F, 2, 2) of four coupled lags, at frequencies [cycles/sample]."""
    z = np.exp(2j * np.pi * frequency)[:, None, None]
    return GAINS * (1 - POLES) / (z - POLES)


def two_by_two(excitation, size, samples, rng, only=None):
    """Inputs, outputs and set-points (N, 2) of these lags, each output under a PI controller.

    ``only`` is the number of the set-point that moves, None: both do.
    """
    r = size * EXCITATIONS[excitation](rng, samples, 2)
    if only is not None:
        r[:, 1 - only] = 0.0
    white = rng.standard_normal((samples + 200, 2))
    noise = lfilter([np.sqrt(1 - CORRELATED**2)], [1, -CORRELATED], white, axis=0)[200:]
    x, total = np.zeros((2, 2)), np.zeros(2)
    u, y = np.empty_like(r), np.empty_like(r)
    for k in range(samples):
        y[k] = x.sum(axis=1) + noise[k]
        total = total + 0.05 * (r[k] - y[k])
        u[k] = 1.5 * (r[k] - y[k]) + total
        x = POLES * x + GAINS * (1 - POLES) * u[k]
    return u, y, r


def records_of(loop, excitation, size, samples, records, rng):
    """Signals u, y and r (N, records) of a loop u = C (r - y), and its plant."""
    plant, controller = LOOPS[loop]()
    r = size * EXCITATIONS[excitation](rng, samples, records)
    white = rng.standard_normal((samples + 200, records))
    noise = lfilter([np.sqrt(1 - CORRELATED**2)], [1, -CORRELATED], white, axis=0)[200:]
    x, z = np.zeros((plant.nstates, records)), np.zeros((controller.nstates, records))
    u, y = np.empty_like(r), np.empty_like(r)
    for k in range(samples):
        y[k] = (plant.C @ x)[0] + noise[k]
        away = r[k] - y[k]
        u[k] = (controller.C @ z)[0] + controller.D[0, 0] * away
        z = controller.A @ z + controller.B * away
        x = plant.A @ x + plant.B * u[k]
    return u, y, r, plant
