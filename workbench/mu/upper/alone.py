"""Multipliers in closed form for a Delta that is one repeated scalar.

With M = V diag(lambda) V^-1 and D = V^-H V^-1, G = V^-H diag(g) V^-1 the inequality of the upper
bound separates into |lambda|^2 - 2 g Im(lambda) <= beta^2, one for each eigenvalue. So mu is the
largest size of an eigenvalue (for a real scalar, of a real eigenvalue), and the bound is exact.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.structure import Full, Real, Structure

REAL_SHARE = 1e-10
"""An eigenvalue counts as real if its imaginary part, relative to its size, is below this. It is
half a million roundings, as eigenvalues of a non-normal matrix have. With half of it a real one may
count as complex, and the proof of its bound fails; with double of it more pairs near the axis count
as real. Every bound is proven.
"""


def is_alone(structure: Structure) -> bool:
    """Whether the structure is a single repeated scalar."""
    blocks = list(structure)
    return len(blocks) == 1 and not isinstance(blocks[0], Full) and blocks[0].rows > 1


def closed_form(M: ComplexArray, structure: Structure) -> tuple[Array, Array, RealArray]:
    """D and G (F, n, n) for matrices (F, n, n), and mu (F,); NaN where rounding hides it.

    If eigenvectors are nearly dependent, the multipliers prove a larger bound.
    """
    size = np.abs(M).max(axis=(1, 2), initial=0.0)
    scale = np.where(size > np.finfo(float).tiny, size, 1.0)[:, None]
    values, V = np.linalg.eig(M / scale[:, None])
    mu = np.abs(values)
    g = np.zeros_like(mu)
    with np.errstate(all="ignore"):
        if isinstance(next(iter(structure)), Real):
            near = np.abs(values.imag) <= REAL_SHARE * mu
            mu = np.where(near, mu, 0.0)
            beta = mu.max(axis=1, keepdims=True)
            g = np.maximum(np.abs(values) ** 2 - beta**2, 0.0) / values.imag
            g = np.where(near, 0.0, g)
        back = np.linalg.inv(np.where(_regular(V)[:, None, None], V, np.eye(V.shape[-1])))
        D: Array = back.conj().mT @ back
        G: Array = back.conj().mT @ (g[..., None] * back) * scale[:, None]
    known = np.where(_regular(V), mu.max(axis=1), np.nan)
    return (D + D.conj().mT) / 2, (G + G.conj().mT) / 2, known * scale[:, 0]


def _regular(V: ComplexArray) -> np.ndarray:
    """Where eigenvectors (F, n, n) are independent enough to be inverted."""
    found: np.ndarray = np.linalg.cond(V) < 1e12
    return found
