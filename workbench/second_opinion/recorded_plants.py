"""Plants drawn from the set that records allow, and their loops: does one contradict the claim?"""

from __future__ import annotations

import math

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.executor.effort import tries
from workbench.second_opinion import SEED
from workbench.second_opinion.powers import growth

PLANTS = 200
"""Number of plants drawn, all of them on the edge of the set."""
ANGLES = 400
"""Number of points of the unit circle at which responses are evaluated."""
REFINEMENTS, REFINED = 3, 21
"""Number of refinements around the worst point, and of points in each."""
ITERATIONS = 60
"""Number of doublings of the time over which costs are summed."""
EDGE_SHARE = 1.0 - 1e-9
"""Size of Delta relative to the edge of the set: rounding must not push a plant out of it."""


def edge_plants(
    regressors: RealArray, after: RealArray, weight: RealArray | None, energy: RealArray
) -> tuple[RealArray, RealArray, RealArray]:
    """Centre (n, n + m) and square roots L (n, n) and R (n + m, n + m) of the set.

    The plants of the set are centre + L Delta R' with |Delta| <= 1. The records are transformed by
    QR; no normal equations are formed.

    Parameters
    ----------
    regressors, after
        Z (n + m, T) and the next states (n, T), with the known noise subtracted.
    weight, energy
        Weight and largest energy of the noise; weight None: the identity.
    """
    root = None if weight is None else np.linalg.cholesky(weight)
    if root is not None:
        regressors, after = regressors @ root, after @ root
    size = np.linalg.norm(regressors, axis=1)
    Q, R = np.linalg.qr((regressors / size[:, None]).T)
    centre = np.linalg.solve(R, Q.T @ after.T).T / size
    residual = after - centre @ regressors
    values, vectors = np.linalg.eigh(energy - residual @ residual.T)
    left = vectors * np.sqrt(np.maximum(values, 0.0))
    right = np.linalg.inv(R) / size[:, None]
    return centre, left, right


def drawn_changes(left: RealArray, right: RealArray) -> RealArray:
    """Changes L Delta R' (plants, n, n + m) to the edge of the set: half of them dyads, half of
    full rank.
    """
    rng, plants = np.random.default_rng(SEED), tries(PLANTS)
    n, total = len(left), len(right)
    Delta = rng.standard_normal((plants, n, total))
    u, _, vh = np.linalg.svd(Delta, full_matrices=False)
    dyads = u[:, :, :1] @ vh[:, :1]
    full = u @ vh
    found: RealArray = (
        EDGE_SHARE * left @ np.where(np.arange(plants)[:, None, None] % 2, full, dyads)
    )
    return found @ right.T


def excess_energy(
    theta: RealArray,
    regressors: RealArray,
    after: RealArray,
    weight: RealArray | None,
    energy: RealArray,
) -> float:
    """Largest relative excess of the noise energy that plants (k, n, n + m) need over the allowed
    one.
    """
    noise = after - theta @ regressors
    spent = noise @ noise.mT if weight is None else noise @ weight @ noise.mT
    root = np.linalg.inv(np.linalg.cholesky(energy))
    return float(np.linalg.eigvalsh(root @ spent @ root.T)[:, -1].max() - 1.0)


def fastest_loop(loops: RealArray, rate: float) -> float:
    """Largest logarithmic growth per sample of loops (k, n, n) above a rate, less its rounding."""
    found, rounding = growth(loops / rate, 1.0)
    return float((found - rounding).max())


def largest_h2(loops: RealArray, entering: RealArray, seen: RealArray) -> float:
    """Largest H2 norm from v to ``seen`` x for x+ = loop x + entering v, summed over 2^60
    samples.
    """
    cost = np.broadcast_to(seen.T @ seen, loops.shape).copy()
    power = loops.copy()
    with np.errstate(all="ignore"):  # an unstable loop gives infinity, or NaN
        for _ in range(ITERATIONS):
            cost = cost + power.mT @ cost @ power
            power = power @ power
        worst = float(np.trace(entering.T @ cost @ entering, axis1=1, axis2=2).max())
    return math.sqrt(worst) if worst < math.inf else math.inf


def largest_response(
    A: RealArray, B: RealArray, C: RealArray, radius: float = 1.0
) -> tuple[float, float]:
    """Largest gain of C (z - A)^-1 B over |z| = radius, and the angle of z [rad] at which it
    occurs.

    A has shape (k, n, n); the gain is the largest over all k.
    """
    angles = np.linspace(0.0, np.pi, tries(ANGLES))
    best, where = 0.0, 0.0
    for _ in range(1 + REFINEMENTS):
        sizes = gains(A, B, C, radius * np.exp(1j * angles)).max(axis=0)
        k = int(np.argmax(sizes))
        if sizes[k] >= best:
            best, where = float(sizes[k]), float(angles[k])
        near = angles[max(k - 1, 0)], angles[min(k + 1, len(angles) - 1)]
        angles = np.linspace(*near, REFINED)
    return best, where


def gains(A: RealArray, B: RealArray, C: RealArray, z: ComplexArray) -> RealArray:
    """Largest singular values (k, F) of C (z - A)^-1 B, for A (k, n, n) and points z (F,)."""
    pencil = z[:, None, None] * np.eye(A.shape[-1]) - A[:, None]
    response = C @ np.linalg.solve(pencil, np.broadcast_to(B, (*pencil.shape[:2], *B.shape)))
    return np.asarray(np.linalg.norm(response, 2, axis=(-2, -1)))


def least_cost(
    A: RealArray, V: RealArray, C: RealArray, rounds: int = 100_000, settled: float = 1e-12
) -> RealArray | None:
    """The least P with P = C'C + A' (P^-1 - V V')^-1 A, by iteration from 0; None if it diverges.

    It is the cost of x+ = A x + V v with an opponent v who pays |v|^2 for it.
    """
    P = np.zeros_like(A)
    for _ in range(rounds):
        room = np.eye(V.shape[1]) - V.T @ P @ V
        if np.linalg.eigvalsh((room + room.T) / 2)[0] <= 0.0:
            return None
        M = P + P @ V @ np.linalg.solve(room, V.T @ P)
        new = C.T @ C + A.T @ M @ A
        new = (new + new.T) / 2
        if not np.isfinite(new).all():
            return None
        done = np.abs(new - P).max() <= settled * np.abs(new).max()
        P = new
        if done:
            return P
    return P
