"""Systems of ten to sixteen real parameters: an aircraft, random matrices, lags, and chains."""

import math
from itertools import product

import control
import numpy as np

from workbench.uncertainty import feedback, real, ss, tf

COEFFICIENTS = {
    "Y_beta": -0.082,
    "Y_p": 0.010827,
    "Y_r": 0.060268,
    "Y_aileron": 0.002,
    "Y_rudder": 0.0118,
    "L_beta": -0.84,
    "L_p": -0.76,
    "L_r": 0.74,
    "L_aileron": 0.095,
    "L_rudder": 0.06,
    "N_beta": 0.092,
    "N_p": -0.23,
    "N_r": -0.114,
    "N_rudder": -0.151,
}


def aircraft():
    """A transport aircraft's lateral motion, 14 coefficients within 10 %, with output feedback.

    G. Ferreres, A Practical Approach to Robustness Analysis with Aeronautical Applications (1999);
    numbers as in "Real Mu Analysis" of the Robust Control Toolbox's documentation.
    """
    y = {name: real(name, value, percent=10) for name, value in COEFFICIENTS.items()}
    gravity, alpha, slope = 0.146418, math.radians(8), 0.14
    A = [
        [y["Y_beta"], y["Y_p"] + math.sin(alpha), y["Y_r"] - math.cos(alpha), gravity],
        [y["L_beta"], y["L_p"], y["L_r"], 0],
        [y["N_beta"], y["N_p"], y["N_r"], 0],
        [0, 1, slope, 0],
    ]
    B = [
        [y["Y_aileron"], y["Y_rudder"]],
        [y["L_aileron"], y["L_rudder"]],
        [0, y["N_rudder"]],
        [0, 0],
    ]
    k = -math.radians(1) / gravity
    C = [[k * y["Y_beta"], k * y["Y_p"], k * y["Y_r"], 0], *np.eye(4)[1:].tolist()]
    D = [[k * y["Y_aileron"], k * y["Y_rudder"]], *np.zeros((3, 2)).tolist()]
    aileron = control.ss(control.tf([-1.77, 399], [1, 48.2, 399]))
    rudder = control.ss(control.tf([2.6, -1185, 27350], [1, 77.7, 3331, 27350]))
    K = [[-629.8858, 11.5254, 3.3110, 9.4278], [285.9496, 0.3693, -2.6301, -0.5489]]
    return feedback(ss(A, B, C, D) * control.append(aileron, rudder), np.array(K))


def random_system(seed):
    """A random matrix with uncertain entries, or with dense terms, every fourth of rank 2."""
    rng = np.random.default_rng(seed)
    count, n = int(rng.integers(10, 17)), int(rng.integers(4, 9))
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    if seed % 2 == 0:
        rows = A.tolist()
        for i, place in enumerate(rng.permutation(n * n)[:count]):
            row, column = divmod(int(place), n)
            rows[row][column] = real(f"a{i}", A[row, column], plus_minus=0.1)
        return ss(rows, np.ones((n, 1)), np.ones((1, n)), 0)
    terms = 0
    for i in range(count):
        rank = 2 if i % 4 == 3 else 1
        term = 0.1 * rng.normal(size=(n, rank)) @ rng.normal(size=(rank, n))
        terms = terms + real(f"k{i}", 0, plus_minus=1) * term
    return ss(A + terms, np.ones((n, 1)), np.ones((1, n)), 0)


def lags_in_series(seed):
    """Unity feedback around five to seven lags whose gains and times are known to 20 %."""
    rng = np.random.default_rng(seed)
    loop = 1
    for i in range(int(rng.integers(5, 8))):
        gain = real(f"k{i}", float(rng.uniform(0.5, 1.2)), percent=20)
        time = real(f"T{i}", float(10 ** rng.uniform(-2, 1)), percent=20)
        loop = loop * tf([gain], [time, 1])
    return feedback(loop, 1)


def chain(damping, seed, gain=0.5):
    """Five masses in a row with rate feedback from the last to the first; 15 parameters, 10 %.

    The feedback has a share of the gain that makes the nominal unstable.
    """
    rng = np.random.default_rng(seed)
    masses, springs = rng.uniform(0.5, 2, 5), rng.uniform(2, 8, 5)
    values = [1 / masses, springs, 2 * damping * np.sqrt(springs * masses)]
    B, C = np.zeros((10, 1)), np.zeros((1, 10))
    B[5], C[0, 9] = 1.0, 1.0
    nominal, most = np.array(_chained(*values)), 1.0
    while _stays(nominal - most * B @ C):
        most *= 2.0
    low, high = 0.0, most
    for _ in range(50):
        middle = (low + high) / 2
        low, high = (middle, high) if _stays(nominal - middle * B @ C) else (low, middle)
    parts = [
        [real(f"{name}{i}", float(value), percent=10) for i, value in enumerate(part)]
        for name, part in zip("mkc", values, strict=True)
    ]
    return feedback(ss(_chained(*parts), B, C, 0), gain * low)


def _chained(inverse, springs, dampers):
    """Rows of A of masses between a wall and a free end."""
    n = len(inverse)
    rows = [[float(j == n + i) for j in range(2 * n)] for i in range(n)]
    for i in range(n):
        row = [0.0] * (2 * n)
        for start, part in ((0, springs), (n, dampers)):
            after = part[i + 1] if i + 1 < n else 0.0
            row[start + i] = -(inverse[i] * (part[i] + after))
            if i:
                row[start + i - 1] = inverse[i] * part[i]
            if i + 1 < n:
                row[start + i + 1] = inverse[i] * after
        rows.append(row)
    return rows


def _stays(A):
    return np.linalg.eigvals(A).real.max() < 0


def best_vertex(given):
    """The least size of a box of which a corner is unstable: all corners, tried by themselves."""
    corners = np.array(list(product((-1.0, 1.0), repeat=len(given.places))))
    last = 0.0
    for size in np.geomspace(1e-2, 1e2, 60):
        unstable = corners[_unstable(given, size * corners)]
        if len(unstable):
            break
        last = size
    for _ in range(40):
        middle = (last + size) / 2
        left = unstable[_unstable(given, middle * unstable)]
        if len(left):
            size, unstable = middle, left
        else:
            last = middle
    return size


def _unstable(given, values):
    """Which members have a pole right of the axis, or lost one through infinity."""
    parts = [given.unstable(values[k : k + 4096]) for k in range(0, len(values), 4096)]
    return np.concatenate(parts)
