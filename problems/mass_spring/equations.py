"""Element equations of the two-mass loop, by which its analysis is checked."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from .plant import B1, B2, CORNER, GAIN, K2, M1, M2, SPRING, weights

SPRINGS_TRIED = 4001
"""Number of springs of each sign among which the worst is searched."""
DELTA_RANGE = (1e-4, 1e5)
"""Smallest and largest |delta| of the springs tried."""


def determinant(omega: float, Delta: np.ndarray) -> complex:
    """det(I - N Delta) at `omega` [rad/s], from the element equations instead of N.

    Delta (4, 4) maps (y_m, z_k1, z_p, z_u) to (u_m, w_k1, d, n). The result is the determinant of
    the loop's equations in z1, z2, u, d, n with Delta, divided by that without Delta.
    """
    s = 1j * omega
    W = {name: complex(weight(s)) for name, weight in weights().items()}

    def loop(dynamics: complex, delta: complex, performance: np.ndarray) -> complex:
        k1 = SPRING.nominal * (1 + SPRING.tolerance * delta)
        link, wall = k1 + B1 * s, K2 + B2 * s
        force = 1 + W["W_m"] * dynamics
        law = GAIN * s / (s + CORNER)
        d, n = performance * [W["W_p"], W["W_u"]]  # from z2 and u
        equations = np.array(
            [
                [M1 * s**2 + link, -link, -force, 0, 0],
                [-link, M2 * s**2 + link + wall, 0, -W["W_d"], 0],
                [0, -law, 1, 0, -law * W["W_n"]],
                [0, -d[0], -d[1], 1, 0],
                [0, -n[0], -n[1], 0, 1],
            ]
        )
        return complex(np.linalg.det(equations))

    with_delta = loop(Delta[0, 0], Delta[1, 1], Delta[2:, 2:])
    return with_delta / loop(0.0, 0.0, np.zeros((2, 2)))


def characteristic_roots(delta: float) -> np.ndarray:
    """Roots [rad/s] of the loop u = K y without weights and unmodelled dynamics."""
    k1 = SPRING.nominal * (1 + SPRING.tolerance * delta)
    link = np.array([B1, k1])
    first = np.polyadd([M1, 0, 0], link)
    second = np.polyadd(np.polyadd([M2, 0, 0], link), [B2, K2])
    free: np.ndarray = np.polysub(np.polymul(first, second), np.polymul(link, link))
    loop = np.polysub(np.polymul(free, [1, CORNER]), np.polymul(link, [GAIN, 0]))
    return np.roots(loop).astype(complex)


def real_spring_mu(omega: np.ndarray) -> np.ndarray:
    """mu of robust stability (F,) at `omega` [rad/s] (F,), for a real spring.

    With the dynamics d and the spring r, det(I - N11 Delta) = a + b d + c r + e d r. Each real r
    has one d at which the determinant is zero. mu is the inverse of the least max(|d|, |r|), which
    a search over r finds.
    """
    return np.array([_real_spring_mu(float(w)) for w in omega])


def _real_spring_mu(omega: float) -> float:
    def corner(d: float, r: float) -> complex:
        return determinant(omega, np.diag([d, r, 0.0, 0.0]))

    a = corner(0, 0)
    b, c = corner(1, 0) - a, corner(0, 1) - a
    e = corner(1, 1) - a - b - c

    def size(r: np.ndarray) -> np.ndarray:
        largest: np.ndarray = np.maximum(abs((a + c * r) / (b + e * r)), abs(r))
        return largest

    best = np.inf
    logs = np.linspace(np.log(DELTA_RANGE[0]), np.log(DELTA_RANGE[1]), SPRINGS_TRIED)
    for sign in (-1.0, 1.0):
        k = int(size(sign * np.exp(logs)).argmin())
        ends = logs[max(k - 1, 0)], logs[min(k + 1, SPRINGS_TRIED - 1)]
        found = minimize_scalar(
            lambda x, sign=sign: float(size(sign * np.exp(np.array([x])))[0]),
            bounds=ends,
            method="bounded",
            options={"xatol": 1e-12},
        )
        best = min(best, float(found.fun))
    return 1 / best
