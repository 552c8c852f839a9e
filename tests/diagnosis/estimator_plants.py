"""A lens on a spring, disturbed by a rotating disc and measured by a filter; records of it."""

import control
import numpy as np

from workbench.diagnosis import DisturbedPlant, Rotation
from workbench.simulation import held_input_matrices, sampled_model

PERIOD = 1e-3
"""Sample time [s]."""


def lens():
    """The lens (12 Hz) and its filter (80 Hz): u, disturbance -> filtered position, position."""
    a = [[0.0, 1.0, 0.0], [-((2 * np.pi * 12) ** 2), -25.0, 0.0], [500.0, 0.0, -500.0]]
    b = [[0.0, 0.0], [3000.0, -3000.0], [0.0, 0.0]]
    return sampled_model(control.ss(a, b, [[0, 0, 1.0], [1.0, 0, 0]], 0.0), PERIOD)


def disturbed(rotation=None, coloured=False, beside=False):
    """The model of the disturbed lens, with coloured noise and a motor beside it if asked for."""
    noise, motor = None, None
    if coloured:
        phi, _ = held_input_matrices([[0.0, 1.0], [-4e4, -280.0]], np.zeros((2, 1)), PERIOD)
        noise = control.ss(phi, [[0.0], [3.0]], [[1.0, 0.0]], 0.0, PERIOD)
    if beside:
        motor = control.ss(0.9, 0.1, 2.0, 0.0, PERIOD)
    return DisturbedPlant(lens(), rotation or Rotation(5.0), colour=noise, unmeasured=motor)


def record(rotation=5.0, samples=4000, noise=0.0, seed=0, harmonics=(1.0,)):
    """A record of the lens: y, the known u, the true position, the disturbance (a sum of sines)."""
    rng = np.random.default_rng(seed)
    time = PERIOD * np.arange(samples)
    shape = [a * np.sin(2 * np.pi * h * rotation * time + h) for h, a in enumerate(harmonics, 1)]
    d = np.sum(shape, axis=0)
    u = 0.3 * np.sign(np.sin(2 * np.pi * 1.7 * time))
    system = lens()
    x, y, position = np.zeros(3), np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        y[k], position[k] = system.C @ x
        x = system.A @ x + system.B @ [u[k], d[k]]
    return y + noise * rng.standard_normal(samples), u, position, d
