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
BLOCK = 32
"""Samples of a block, a power of two; those within a block are simulated together."""
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

    A block of samples is one step of a larger system: its input is all that enters in the block,
    its output all that leaves.
    """
    (n, r), c = B.shape, len(C)
    blocks = -(-len(w) // BLOCK)
    entering = np.zeros((blocks, BLOCK * r))
    entering.reshape(blocks * BLOCK, r)[: len(w)] = w
    reached, seen = [B], [C]
    for _ in range(BLOCK - 1):
        reached.append(A @ reached[-1])
        seen.append(seen[-1] @ A)
    into, out = np.hstack(reached[::-1]), np.vstack(seen)
    through = np.zeros((BLOCK, c, BLOCK, r))  # the outputs of a block for its own inputs
    for k in range(BLOCK):
        response = D if k == 0 else C @ reached[k - 1]
        for i in range(BLOCK - k):
            through[i + k, :, i] = response
    states, added = np.zeros((blocks, n)), entering @ into.T
    power = np.linalg.matrix_power(A, BLOCK)
    for k in range(1, blocks):
        states[k] = power @ states[k - 1] + added[k - 1]
    leaving = states @ out.T + entering @ through.reshape(BLOCK * c, BLOCK * r).T
    return leaving.reshape(blocks * BLOCK, c)[: len(w)]


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
