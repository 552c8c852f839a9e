"""Scalings fitted to a loop: the worst of sigma_max(D M D^-1) over a reference is made least.

The worst over frequencies is smoothed as log sum (sigma_j / reference)^s / s over all singular
values and frequencies, s rising. Each frequency's sum is convex in the logarithms of D, with a
second derivative in closed form (that of a trace function), so that Newton's method takes tens of
steps where gradients alone take hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.arrays import Array, RealArray
from workbench.structure import Structure
from workbench.synthesis.mu.scalings import Scalings, diagonals

Fitted = tuple[Scalings, RealArray]
"""Scalings and their parameters (blocks, P)."""
SHARPNESS = (8.0, 60.0, 400.0)
"""Exponents s, each started from the minimum of the one before."""
SETTLED = 2e-5
"""Fall of the logarithm that a step must promise, or bring, for another one."""
STEPS, FARTHEST = 40, 2.0
"""Newton steps for an exponent, and the largest, in logarithms of parameters."""
EASED, TIGHTENED = 0.2, 6.0
"""Factors on the damping after a step that went as promised, and after one that rose."""
PLAIN = 1e-4
"""Weight of the logarithms of damping: what the loop does not need stays plain."""
MOST_BIQUADS = 4
GOOD = 5e-4
"""By how much fitted scalings may miss the reference where more biquads are not worth it."""
SPLIT = 0.3
"""Logarithm by which a new biquad's zeros and poles start to either side of its place."""
TINY = 1e-100
"""Least eigenvalue: of zero rows and columns they are zero."""
SAME = 1e-7
"""Relative distance of eigenvalues up to which a divided difference is a derivative."""
FLAT = 1e-3
"""Change of the response, relative, up to which a frequency tells nothing beyond the last one."""


@dataclass(frozen=True, eq=False)
class Fit:
    """What scalings of the first blocks of a structure are fitted to.

    ``M`` (F, n, n) is the response with zeros that make it square, over the reference.
    """

    structure: Structure
    omega: RealArray
    M: Array

    @classmethod
    def of(cls, structure: Structure, omega: RealArray, M: Array, reference: RealArray) -> Fit:
        """From responses (F, c, r) at omega (F,) [rad/s] and a reference (F,)."""
        kept = _telling(M)
        M = M[kept] / reference[kept, None, None]
        n = max(M.shape[1:])
        square = np.zeros((len(M), n, n), complex)
        square[:, : M.shape[1], : M.shape[2]] = M
        return cls(structure, omega[kept], square)

    def missed(self, scalings: Scalings, x: RealArray) -> tuple[float, float]:
        """log of the worst sigma_max(D M D^-1) over the reference, and its frequency [rad/s]."""
        scaled = self._scaled(scalings.log_magnitude(x, self.omega)[0])
        size = np.linalg.svd(scaled, compute_uv=False)[:, 0]
        worst = int(np.argmax(size))
        return float(np.log(size[worst])), float(self.omega[worst])

    def grown(self, start: Fitted, omega: float) -> Fitted:
        """With a biquad more about omega [rad/s], split the way that lowers the worst."""
        scalings, x = start[0].grown(start[1], omega, np.zeros(start[0].rows))
        _, gradient, _ = self._cost(scalings, x.ravel(), SHARPNESS[1])
        slope = gradient.reshape(x.shape)[:, start[0].size]
        return start[0].grown(start[1], omega, -SPLIT * np.sign(slope))

    def near(self, scalings: Scalings, x: RealArray) -> RealArray:
        """The best parameters (blocks, P) near x."""
        low, high = scalings.limits(self.omega[1:-1] if len(self.omega) > 2 else self.omega)
        flat = np.clip(x.ravel(), low, high)
        for sharpness in SHARPNESS:
            flat = self._minimum(scalings, flat, sharpness, low, high)
        return flat.reshape(x.shape)

    def _minimum(
        self, scalings: Scalings, flat: RealArray, sharpness: float, low: RealArray, high: RealArray
    ) -> RealArray:
        """Damped Newton steps in a box."""
        value, gradient, hessian = self._cost(scalings, flat, sharpness)
        damping = 1e-2 * float(np.abs(np.diag(hessian)).max())
        for _ in range(STEPS):
            free = (flat > low) | (gradient < 0.0)
            free &= (flat < high) | (gradient > 0.0)
            curvature, turn = np.linalg.eigh(hessian[np.ix_(free, free)])
            step = np.zeros_like(flat)
            step[free] = -turn @ ((turn.T @ gradient[free]) / (np.abs(curvature) + damping))
            step *= min(1.0, FARTHEST / max(float(np.abs(step).max(initial=0.0)), FARTHEST))
            trial = np.clip(flat + step, low, high)
            step = trial - flat
            if -float(gradient @ step) < SETTLED:
                break
            promised = -float(gradient @ step + step @ hessian @ step / 2)
            new = self._cost(scalings, trial, sharpness)
            fall = value - new[0]
            if not fall > 0.0:
                damping *= TIGHTENED
                continue
            if fall > promised / 2:
                damping *= EASED
            flat, (value, gradient, hessian) = trial, new
            if fall < SETTLED:
                break
        return flat

    def _cost(
        self, scalings: Scalings, flat: RealArray, sharpness: float
    ) -> tuple[float, RealArray, RealArray]:
        """The smoothed worst, its gradient and Hessian with parameters."""
        x = flat.reshape(scalings.rows, scalings.size)
        log, slope = scalings.log_magnitude(x, self.omega)
        value, by_log, bent = self._smoothed(log, sharpness)
        gradient = (slope @ by_log[:, :, None])[:, :, 0].ravel()
        B, P = x.shape
        hessian = np.zeros((B, P, B, P))
        for b, curved in enumerate(scalings.bending(x, self.omega, by_log)):
            for c in range(B):
                hessian[b, :, c] = (slope[b] * bent[b, c]) @ slope[c].T
            hessian[b, :, b] += curved
        hessian = hessian.reshape(B * P, B * P) - sharpness * np.outer(gradient, gradient)
        plain = PLAIN * scalings.dampings
        value += float(plain @ flat**2)
        return value, gradient + 2 * plain * flat, hessian + 2 * np.diag(plain)

    def _smoothed(self, log: RealArray, sharpness: float) -> tuple[float, RealArray, RealArray]:
        """log sum sigma^s / s, its slopes (B, F) with log d, and of the sum within a frequency
        the second derivatives (B, B, F) over s times the sum.

        With X = Y^H Y of eigenvalues e, the sum of e^m, m = s / 2, has the second differential
        sum_jk f'[e_j, e_k] |dX_jk|^2 + sum_j f'(e_j) d2X_jj in the basis of its eigenvectors,
        f'(e) = m e^(m-1) and f'[.,.] its divided differences.
        """
        U, size, Vh = np.linalg.svd(self._scaled(log))
        m = sharpness / 2
        values = np.maximum(size**2, TINY)
        exponent = m * np.log(values)
        most = float(exponent.max())
        weight = np.exp(exponent - most)
        total = float(weight.sum())
        weight /= total
        value = (most + np.log(total / len(values))) / sharpness
        R, C = np.empty((2, len(log), *U.shape), complex)
        for b in range(len(log)):
            out, into = (
                U[:, self.structure.column_slices[b]],
                Vh[:, :, self.structure.row_slices[b]],
            )
            R[b], C[b] = out.conj().mT @ out, into @ into.conj().mT
        slopes = ((np.diagonal(R, 0, 2, 3) - np.diagonal(C, 0, 2, 3)).real * weight).sum(axis=-1)
        first = m * weight / values
        Z = size[:, :, None] * size[:, None, :] * R
        dX = 2 * Z - (values[:, :, None] + values[:, None, :]) * C
        # d2X_bc, jj = -2 Re (C_b dX_c)_jj - 4 Re (C_c Z_b)_jj, and 4 Z_b, jj where b is c.
        bent = _products(_divided(values, first, m) * dX, dX)
        bent -= _products(2 * first[:, :, None] * C, dX)
        bent -= _products(4 * first[:, :, None] * Z, C)
        own = np.arange(len(log))
        bent[:, own, own] += 4 * (first * np.diagonal(Z, 0, 2, 3).real).sum(axis=-1).T
        bent = bent.transpose(1, 2, 0) / sharpness
        return value, slopes, bent

    def _scaled(self, log: RealArray) -> Array:
        rows, columns = diagonals(self.structure, log)
        scaled = self.M.copy()
        scaled[:, : rows.shape[1], : columns.shape[1]] *= np.exp(
            rows[:, :, None] - columns[:, None, :]
        )
        return scaled


def _products(left: Array, right: Array) -> RealArray:
    """Sums over entries of left_b conj(right_c), real parts: (B, F, n, n) twice to (F, B, B)."""
    B, F = left.shape[:2]
    a, b = (np.moveaxis(one.reshape(B, F, -1), 0, 1) for one in (left, right))
    product: RealArray = (a @ b.conj().mT).real
    return product


def worth(fit: Fit, start: Fitted) -> tuple[Fitted, float]:
    """Scalings by as few biquads as do, and the logarithm of what they miss.

    From the start, which may have none: those without the one of its own that matters least, and
    those with one more where most is missed, again and again while that is worth it.
    """
    tried = [_near(fit, start)]
    (scalings, x), _, _ = tried[0]
    if scalings.biquads:
        fewer = [scalings.without(x, k) for k in range(scalings.biquads)]
        tried.append(_near(fit, min(fewer, key=lambda one: fit.missed(*one)[0])))
        tried.sort(key=lambda one: one[1])
    found, missed, at = tried[0]
    while missed > GOOD and found[0].biquads < MOST_BIQUADS:
        found, missed, at = _near(fit, fit.grown(found, at))
        tried.append((found, missed, at))
    least = min(missed for _, missed, _ in tried)
    good = [one for one in tried if one[1] <= least + GOOD]
    found, missed, _ = min(good, key=lambda one: (one[0][0].biquads, one[1]))
    return found, missed


def _near(fit: Fit, start: Fitted) -> tuple[Fitted, float, float]:
    """The best scalings near some, what they miss, and where."""
    found = start[0], fit.near(*start)
    return found, *fit.missed(*found)


def _divided(values: RealArray, first: RealArray, m: float) -> RealArray:
    """Divided differences (F, n, n) of f' between eigenvalues; first is f' (F, n)."""
    a, b = values[:, :, None], values[:, None, :]
    near = np.abs(a - b) < SAME * (a + b)
    with np.errstate(all="ignore"):
        apart = (first[:, :, None] - first[:, None, :]) / (a - b)
    same = (m - 1) * (first / values)
    return np.where(near, (same[:, :, None] + same[:, None, :]) / 2, apart)


def _telling(M: Array) -> NDArray[np.bool_]:
    """Frequencies at which the response differs from that at the last one taken; both ends."""
    kept = np.zeros(len(M), dtype=bool)
    kept[[0, -1]] = True
    last = M[0]
    for k, one in enumerate(M):
        if np.abs(one - last).max() > FLAT * np.abs(last).max():
            kept[k], last = True, one
    return kept
