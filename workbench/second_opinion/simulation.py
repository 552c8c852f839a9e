"""Energies of simulated loops: no response and no eigenvalue is computed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from workbench.arrays import EPS, RealArray
from workbench.second_opinion import SEED

Realisation = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""

SAMPLES = 3000
"""Samples simulated."""
SAMPLES_PER_PERIOD = 16
"""Samples in a period of the sinusoid that drives a continuous loop."""
BLOCK = 16
"""Samples of a block, a power of two; the blocks are simulated together."""
NEIGHBOURS = 3
"""Loops that are simulated to see what rounding does."""
SPREAD = 4.0
"""Rounding error of an output over the largest difference from those loops."""
PASSES = 3
"""Times that the loop is driven: each time by what came out before, run backwards."""


def energy_ratio(matrices: Any, dt: float | None, omega: float, claimed: float = 0.0) -> float:
    """Largest root of the ratio of output and input energy that simulations of a loop show.

    Where it is above `claimed`, the same input is simulated by loops that rounding cannot tell from
    the given one, and the output counts less a multiple of the largest difference.

    A continuous loop is simulated after the bilinear transformation, which keeps its norm. The
    first input is a sinusoid; each next one is the adjoint's response to the last output, so that
    the ratio rises towards the norm (power iteration in time).

    Parameters
    ----------
    matrices
        A, B, C, D of a stable loop.
    dt
        Its sampling time [s]; 0 or None in continuous time.
    omega
        Frequency of the first input [rad/s]; where it is not finite and positive, noise is taken.
    claimed
        Claimed bound of the ratio.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in matrices)
    if 0 in D.shape:
        return 0.0
    known = 0.0 < omega < math.inf
    given = A, B, C, D
    if not dt:
        A, B, C, D = _bilinear(given, omega if known else None)
    rng = np.random.default_rng(SEED)
    w = rng.standard_normal((SAMPLES, D.shape[1]))
    if known:
        turn = omega * dt if dt else 2 * math.atan(math.pi / SAMPLES_PER_PERIOD)
        w = np.sin(turn * np.arange(SAMPLES)[:, None] + rng.uniform(0, 2 * math.pi, D.shape[1]))
    ratio, near = 0.0, list[Realisation]()
    for _ in range(PASSES):
        z = _run(A, B, C, D, w)
        size = float(np.linalg.norm(z))
        if size > claimed * np.linalg.norm(w):
            if not near:
                near = _neighbours(given)
                near = near if dt else [_bilinear(one, omega if known else None) for one in near]
            size -= SPREAD * max(float(np.linalg.norm(z - _run(*one, w))) for one in near)
        ratio = max(ratio, size / float(np.linalg.norm(w)))
        if not np.any(z):
            break
        w = _run(A.T, C.T, B.T, D.T, z[::-1])[::-1]  # the adjoint, backwards in time
        w = w / (np.linalg.norm(w) or 1.0)
        if not np.any(w):
            break
    return ratio


def _run(A: RealArray, B: RealArray, C: RealArray, D: RealArray, w: RealArray) -> RealArray:
    """Outputs (N, outputs) of the loop from rest, driven by w (N, inputs).

    All blocks of samples are simulated from rest together, and then what the state at the start of
    each block adds.
    """
    blocks, n = -(-len(w) // BLOCK), len(A)
    entering = np.zeros((blocks * BLOCK, n))
    entering[: len(w)] = w @ B.T
    after = entering.reshape(blocks, BLOCK, n)  # the states after each sample of a block
    powers = [np.eye(n)]
    for _ in range(BLOCK):
        powers.append(A @ powers[-1])
    for span in (2**k for k in range(BLOCK.bit_length() - 1)):
        after[:, span:] += after[:, :-span] @ powers[span].T  # the right side is made first
    start = np.zeros((blocks, n))
    for k in range(1, blocks):
        start[k] = powers[BLOCK] @ start[k - 1] + after[k - 1, -1]
    before = np.concatenate([np.zeros((blocks, 1, n)), after[:, :-1]], axis=1)
    before += (start @ np.stack(powers[:BLOCK]).mT).transpose(1, 0, 2)
    states = before.reshape(blocks * BLOCK, n)[: len(w)]
    return states @ C.T + w @ D.T


def _neighbours(given: Realisation) -> list[Realisation]:
    """The loop with its states in other orders and every entry one rounding larger or smaller.

    Another order alone leaves many roundings what they are: of 29 ill-conditioned loops that
    rounding raised above their norm, it explained 20, these explained all.
    """
    A, B, C, D = given
    rng, found = np.random.default_rng(SEED), []
    for _ in range(NEIGHBOURS):
        order = rng.permutation(len(A))
        parts = A[np.ix_(order, order)], B[order], C[:, order], D
        A_, B_, C_, D_ = (part * (1 + EPS * rng.choice([-1.0, 1.0], part.shape)) for part in parts)
        found.append((A_, B_, C_, D_))
    return found


def _bilinear(given: Realisation, omega: float | None) -> Realisation:
    """The sampled loop with s = a (z - 1) / (z + 1), `omega` at 16 samples in a period."""
    A, B, C, D = given
    if len(A):
        A, (scale, _) = matrix_balance(A, permute=False, separate=True)
        B, C = B / scale[:, None], C * scale
    a = omega * SAMPLES_PER_PERIOD / math.pi if omega else float(np.linalg.norm(A)) or 1.0
    resolvent = np.linalg.inv(a * np.eye(len(A)) - A)
    root = math.sqrt(2 * a)
    return (
        resolvent @ (a * np.eye(len(A)) + A),
        root * resolvent @ B,
        root * C @ resolvent,
        D + C @ resolvent @ B,
    )
