"""Least energies of outputs by dynamic programming, and graphs of plants as sequences in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.executor.effort import tries

DOUBLINGS = 60
"""Largest number of doublings of the horizon."""
CONVERGED = 1e-10
"""The energies count as those of the infinite horizon once the last doubling changes them by less
than this, relative.
"""
SAMPLES, LARGEST = 120, 1200
"""Number of samples of the graphs in time, and largest number of rows of their matrices."""
UNIT = (1.0 + 5.0**0.5) / 2.0
"""Ratio of the rate of transformations to a system's own rates, chosen to keep off its poles and
zeros.
"""

Realisation = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""


def in_samples(system: Any, rate: float) -> Realisation:
    """A sampled system whose signals have the energies of the continuous ones.

    The sequences are the coefficients of the signals in Laguerre functions of a rate [rad/s]. The
    initial state x(0) is the same for both systems.
    """
    A, B, C, D = (np.asarray(getattr(system, part), dtype=float) for part in "ABCD")
    back = np.linalg.inv(rate * np.eye(len(A)) - A)
    root = np.sqrt(2.0 * rate)
    return back @ (rate * np.eye(len(A)) + A), root * back @ B, root * C @ back, D + C @ back @ B


def least_energy(matrices: Realisation) -> RealArray | None:
    """X with x'X x the least energy of the outputs C x + D u from a state x, over all inputs u.

    Dynamic programming over horizons of 1, 2, 4, ... samples; None if it does not converge.
    """
    A, B, C, D = matrices
    n, R = len(A), D.T @ D
    if np.linalg.matrix_rank(R) < len(R):
        return None
    gain = np.linalg.solve(R, D.T @ C)  # for the input that minimises the first output
    A, rest = A - B @ gain, C - D @ gain
    G, H = B @ np.linalg.solve(R, B.T), rest.T @ rest
    with np.errstate(all="ignore"):
        for _ in range(DOUBLINGS):
            inner = np.linalg.inv(np.eye(n) + G @ H)
            more = A.T @ H @ inner @ A
            G, H, A = G + A @ inner @ G @ A.T, H + (more + more.T) / 2, A @ inner @ A
            if not np.isfinite(H).all():
                return None
            if np.abs(more).max(initial=0.0) <= CONVERGED * np.abs(H).max(initial=0.0):
                return H
    return None


def graph_distance(first: Realisation, second: Realisation) -> float:
    """A lower bound of the directed gap from one sampled plant's graph to another's.

    The graph contains all pairs of an input and an output with finite energy. A pair of the first
    plant, driven for some samples, is compared over these samples with all pairs of the second
    plant; 0 if a plant numerically has no such pairs.
    """
    samples = min(tries(SAMPLES), LARGEST // (first[3].shape[0] + first[3].shape[1]))
    pairs = [_pairs(plant, samples) for plant in (first, second)]
    if pairs[0] is None or pairs[1] is None:
        return 0.0
    basis = np.linalg.qr(pairs[1])[0]
    away = pairs[0] - basis @ (basis.T @ pairs[0])
    return float(np.linalg.norm(away, 2))


def _pairs(plant: Realisation, samples: int) -> RealArray | None:
    """First samples of inputs and outputs for orthonormal drives, as columns with energy 1 over all
    time.

    The input is u = v - F x, where F is the feedback of least energy, so that after v ends the
    signals decay with the least energy. The energy of both signals is v'(I + D'D + B'X B) v, summed
    over the samples.
    """
    A, B, C, D = plant
    n, m = B.shape
    whole = np.vstack([np.zeros((m, n)), C]), np.vstack([np.eye(m), D])
    X = least_energy((A, B, *whole))
    if X is None:
        return None
    R = whole[1].T @ whole[1] + B.T @ X @ B
    F = np.linalg.solve(R, B.T @ X @ A + whole[1].T @ whole[0])
    drive = np.linalg.inv(np.linalg.cholesky(R)).T
    A, B, C, D = A - B @ F, B @ drive, whole[0] - whole[1] @ F, whole[1] @ drive
    width, found = len(C), np.zeros((samples, len(C), samples, m))
    response, state = D, B
    for k in range(samples):
        for i in range(samples - k):
            found[i + k, :, i] = response
        response, state = C @ state, A @ state
    return found.reshape(samples * width, samples * m)
