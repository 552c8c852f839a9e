"""Sampled controllers on continuous plants, perturbed by constants and all-pass functions.

The plant is closed by the perturbation in continuous time and sampled by matrix exponentials: no
response at any frequency is computed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.linalg import block_diag, expm

from workbench._core.arrays import RealArray
from workbench.certificate import Check
from workbench.executor.effort import tries
from workbench.second_opinion import SEED
from workbench.second_opinion.loops import BALL_SHARE
from workbench.second_opinion.powers import growth

DRAWN = 30
"""Number of perturbations that close a loop: two constants, the others all-pass."""
REACH = 1e3
"""Poles of all-pass perturbations lie between the sampling rate divided by this and times this."""

Realisation = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""


def loops_held(parts: Any, K: Any, delay: float, sign: int, claimed: float) -> Check:
    """Check that loops with dynamics of a gain below the claimed margin are stable.

    Parameters
    ----------
    parts
        Continuous StateSpace with inputs (w, u) and outputs (z, y), w = Delta z.
    K
        Sampled StateSpace, u = sign K y, and its ``delay`` [samples].
    claimed
        The margin.
    """
    period, fastest, count = float(K.dt), -math.inf, 0
    for Delta in _perturbations(min(claimed, 1e6) * BALL_SHARE, 1 / period):
        loop = _closed_transition(_held(_with(parts, Delta), period, delay), K, sign)
        rate, rounding = growth(loop, period)
        fastest, count = max(fastest, rate - rounding), count + 1
    return Check(
        "sampled loops are stable",
        "logarithmic growth of a loop per sample, less its rounding",
        fastest,
        0.0,
        over=f"for {count} constant and all-pass perturbations",
    )


def _perturbations(size: float, rate: float) -> Iterator[Realisation]:
    """Dynamics of gain `size` at every frequency: +-r, then +-r prod (a_i - s) / (a_i + s)."""
    rng = np.random.default_rng(SEED)
    for k in range(tries(DRAWN)):
        gain = size * (1 if k % 2 else -1)
        system = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])
        for pole in rate * REACH ** rng.uniform(-1, 1, size=0 if k < 2 else 1 + k % 3):
            system = _before_all_pass(system, pole)
        yield system


def _before_all_pass(system: Realisation, pole: float) -> Realisation:
    """A system followed by (a - s) / (a + s) = 2 a / (a + s) - 1."""
    A, B, C, D = system
    whole = np.block([[A, np.zeros((len(A), 1))], [C, np.array([[-pole]])]])
    out = np.hstack([-C, np.array([[2 * pole]])])
    return whole, np.vstack([B, D]), out, -D


def _with(parts: Any, Delta: Realisation) -> Realisation:
    """The plant from u to y, with dynamics closed from z to w."""
    A, B, C, D = (np.asarray(getattr(parts, part), dtype=float) for part in "ABCD")
    a, b, c, d = Delta
    # w = c x + d z and z = C0 X + D00 w + D01 u.
    free = 1 / (1 - d[0, 0] * D[0, 0])
    W = free * np.hstack([d @ C[:1], c, d * D[0, 1]])  # state (X, x), input u
    Z = np.hstack([C[:1], np.zeros((1, len(a))), D[:1, 1:]]) + D[0, 0] * W
    n = len(A) + len(a)
    whole = np.hstack([block_diag(A, a), np.vstack([B[:, 1:], np.zeros((len(a), 1))])])
    whole = whole + np.vstack([B[:, :1] @ W, b @ Z])
    y = np.hstack([C[1:], np.zeros((1, len(a))), D[1:, 1:]]) + D[1, 0] * W
    return whole[:, :n], whole[:, n:], y[:, :n], y[:, n:]


def _held(plant: Realisation, period: float, delay: float) -> Realisation:
    """The sampled plant, with an input that is held and delayed by some samples."""
    A, B, C, D = plant
    n, whole = len(A), int(delay)
    late = (delay - whole) * period
    old, new = _driven(A, B, late), _driven(A, B, period - late)
    # For a part of the period the input of one sample before acts, then the newest one.
    power, before = new[0] @ old[0], new[0] @ old[1]
    memory = whole + 1
    shift = np.eye(memory, k=-1)
    found = np.zeros((n + memory, n + memory))
    found[:n, :n], found[n:, n:] = power, shift
    enters = np.vstack([np.zeros((n, 1)), np.eye(memory, 1)])
    found[:n, n + whole] += before[:, 0]  # u[k - whole - 1]
    if whole:
        found[:n, n + whole - 1] += new[1][:, 0]  # u[k - whole]
    else:
        enters[:n] = new[1]
    out = np.hstack([C, np.zeros((1, memory))])
    return found, enters, out, D


def _driven(A: RealArray, B: RealArray, time: float) -> tuple[RealArray, RealArray]:
    """Transition of the state over a time, and the contribution of a constant input."""
    n, m = B.shape
    whole = expm(time * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


def _closed_transition(plant: Realisation, K: Any, sign: int) -> RealArray:
    """Transition of the loop over one sample; the plant responds no sooner than at the next
    sample.
    """
    A, B, C, _ = plant
    a, b, c, d = (np.asarray(getattr(K, part), dtype=float) for part in "ABCD")
    control = sign * np.hstack([d @ C, c])
    return np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]]) + np.vstack(
        [B @ control, np.zeros((len(a), len(A) + len(a)))]
    )
