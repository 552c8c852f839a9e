"""Energies of simulated loops: no response and no eigenvalue is computed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import matrix_balance

from workbench._core.arrays import EPS, RealArray
from workbench.executor.effort import tries
from workbench.second_opinion import SEED

Realisation = tuple[RealArray, RealArray, RealArray, RealArray]
"""A, B, C and D."""

SAMPLES = 3000
"""Number of samples simulated."""
SAMPLES_PER_PERIOD = 16
"""Number of samples per period of the sinusoid that drives a continuous loop."""
BLOCK = 32
"""Number of samples in a block, a power of two; the samples of a block are simulated together."""
NEIGHBOURS = 3
"""Number of slightly changed loops that are simulated to see the effect of rounding."""
SPREAD = 4.0
"""Rounding error of an output, in units of the largest difference between those loops."""
PASSES = 3
"""Number of times that the loop is driven, each time by its last output reversed in time."""


def energy_ratio(matrices: Any, dt: float | None, omega: float, claimed: float = 0.0) -> float:
    """Largest root of the ratio of output and input energy that simulations of a loop show.

    If it is above `claimed`, the same input is simulated with loops that differ from the given one
    only by rounding, and the output is reduced by a multiple of the largest difference.

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
        Frequency of the first input [rad/s]; if it is not finite and positive, the input is noise.
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
    samples = tries(SAMPLES)
    w = rng.standard_normal((samples, D.shape[1]))
    if known:
        turn = omega * dt if dt else 2 * math.atan(math.pi / SAMPLES_PER_PERIOD)
        w = np.sin(turn * np.arange(samples)[:, None] + rng.uniform(0, 2 * math.pi, D.shape[1]))
    loop = _Blocks(A, B, C, D)
    adjoint = loop.adjoint()
    ratio, near = 0.0, list[_Blocks]()
    for _ in range(PASSES):
        z = loop.run(w)
        size = float(np.linalg.norm(z))
        if size > claimed * np.linalg.norm(w):
            if not near:
                others = _neighbours(given)
                if not dt:
                    others = [_bilinear(one, omega if known else None) for one in others]
                near = [_Blocks(*one) for one in others]
            size -= SPREAD * max(float(np.linalg.norm(z - one.run(w))) for one in near)
        ratio = max(ratio, size / float(np.linalg.norm(w)))
        if not np.any(z):
            break
        w = adjoint.run(z[::-1])[::-1]  # backwards in time
        w = w / (np.linalg.norm(w) or 1.0)
        if not np.any(w):
            break
    return ratio


class _Blocks:
    """A sampled loop in blocks of samples: each block is one step of a larger system.

    Its input collects all inputs of the block, and its output all outputs.
    """

    def __init__(self, A: RealArray, B: RealArray, C: RealArray, D: RealArray) -> None:
        r, c = B.shape[1], len(C)
        reached, seen = [B], [C]
        for _ in range(BLOCK - 1):
            reached.append(A @ reached[-1])
            seen.append(seen[-1] @ A)
        through = np.zeros((BLOCK, c, BLOCK, r))  # the outputs of a block caused by its own inputs
        for k in range(BLOCK):
            response = D if k == 0 else C @ reached[k - 1]
            for i in range(BLOCK - k):
                through[i + k, :, i] = response
        self.power: RealArray = np.linalg.matrix_power(A, BLOCK)
        self.into, self.out, self.through = np.hstack(reached[::-1]), np.vstack(seen), through

    def adjoint(self) -> _Blocks:
        """The blocks of A^T, C^T, B^T and D^T: the same products, in the other order."""
        found = object.__new__(_Blocks)
        found.power = self.power.T
        c, r = self.through.shape[1::2]
        n = len(self.power)
        found.into = self.out.T.reshape(n, BLOCK, c)[:, ::-1].reshape(n, BLOCK * c)
        found.out = self.into.T.reshape(BLOCK, r, n)[::-1].reshape(BLOCK * r, n)
        found.through = self.through.transpose(2, 3, 0, 1)[::-1, :, ::-1]
        return found

    def run(self, w: RealArray) -> RealArray:
        """Outputs (N, outputs) from rest, driven by w (N, inputs)."""
        _, c, _, r = self.through.shape
        blocks = -(-len(w) // BLOCK)
        entering = np.zeros((blocks, BLOCK * r))
        entering.reshape(blocks * BLOCK, r)[: len(w)] = w
        states, added = np.zeros((blocks, len(self.power))), entering @ self.into.T
        for k in range(1, blocks):
            states[k] = self.power @ states[k - 1] + added[k - 1]
        own = entering @ self.through.reshape(BLOCK * c, BLOCK * r).T
        return (states @ self.out.T + own).reshape(blocks * BLOCK, c)[: len(w)]


def _neighbours(given: Realisation) -> list[Realisation]:
    """The loop with its states in other orders and every entry one rounding larger or smaller.

    Another order alone leaves many roundings unchanged: of 29 ill-conditioned loops that rounding
    raised above their norm, it explained 20, and these changes explained all.
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
    """The sampled loop with s = a (z - 1) / (z + 1), such that `omega` has 16 samples per
    period.
    """
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
