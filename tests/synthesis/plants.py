"""Plants of the tests."""

import control
import numpy as np

from workbench.systems.generalised_plant import GeneralisedPlant


def random_plant(seed, dt=0.0):
    """Up to 12 states, stable or not, not square, with and without D11 and D22, in odd units."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13))
    u, y = (int(k) for k in rng.integers(1, 4, 2))
    w, z = y + int(rng.integers(0, 3)), u + int(rng.integers(0, 3))
    A = rng.normal(size=(n, n)) / np.sqrt(n)
    A = A * rng.uniform(0.5, 1.3) if dt else A - rng.uniform(-0.5, 1.5) * np.eye(n)
    B, C = rng.normal(size=(n, w + u)), rng.normal(size=(z + y, n))
    D = rng.normal(size=(z + y, w + u))
    D[:z, :w] *= rng.choice([0.0, 1.0])
    D[z:, w:] *= rng.choice([0.0, 0.5])
    units = np.exp(2 * rng.normal(size=n))
    rate = 1.0 if dt else 10 ** rng.uniform(-4, 6)
    A = A * units[:, None] / units * rate
    B, C = B * units[:, None] * rate**0.5, C / units * rate**0.5
    B[:, w:] *= 10 ** rng.uniform(-5, 5)
    return GeneralisedPlant(control.ss(A, B, C, D, dt), None, u, y)


def scalar_plant(a, D22=0.0):
    """x' = a x + w1 + u, z = (x, u), y = x + w2 + D22 u.

    X = Y solves 2 a X + 1 = (1 - 1 / gamma^2) X^2, and X = gamma at the least level, so that
    gamma = a + sqrt(a^2 + 2).
    """
    B, C = [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]]
    D = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, D22]]
    return control.ss([[a]], B, C, D)


def stacked(G, W_S, W_KS):
    from workbench.synthesis import MixedSensitivity

    return MixedSensitivity(G, W_S=W_S, W_KS=W_KS).plant.system


s = control.tf("s")
TEXTBOOK = {
    # Skogestad, Postlethwaite (1996), example 2.11: 200 / ((10 s + 1) (0.05 s + 1)^2), norm 1.37.
    "skogestad": lambda: stacked(
        200 / ((10 * s + 1) * (0.05 * s + 1) ** 2), (s / 1.5 + 10) / (s + 1e-3), 1.0
    ),
    "unstable": lambda: stacked(1 / (s - 1), (s + 1) / (s + 0.1), 0.5),
    "flexible": lambda: stacked(1 / (s**2 + 0.1 * s + 1), (s + 1) / (2 * s + 0.02), 0.1),
    "scalar": lambda: scalar_plant(1.0),
}
"""Makes the system of each, with one measurement and one control."""
