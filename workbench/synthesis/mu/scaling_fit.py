"""Fit of scalings to a loop: minimise the worst ratio of sigma_max(D M D^-1) to a reference.

The maximum over frequency is replaced by the smooth log sum (sigma_j / reference)^s / s over all
singular values and frequencies, with rising s. The sum at each frequency is convex in the
logarithms of D and has a second derivative in closed form, that of a trace function. Newton's
method therefore takes tens of steps where gradient methods take hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import EPS, Array, RealArray
from workbench.executor.clock import tick
from workbench.structure import Structure
from workbench.synthesis.mu.scalings import Scalings, diagonals

Fitted = tuple[Scalings, RealArray]
"""Scalings and their parameters (blocks, P)."""


class Fineness(NamedTuple):
    """How finely scalings are fitted.

    ``sharpness`` are the exponents s; the fit of each starts from the minimum of the one before. A
    fit ends when a step promises, or brings, a fall of the logarithm below ``settled``. A frequency
    is left out if the response changed by less than the share ``change`` since the last one.
    ``biquads`` is the largest number of biquads of a scaling.
    """

    sharpness: tuple[float, ...]
    settled: float
    change: float
    biquads: int


FINE = Fineness((8.0, 60.0, 400.0), 2e-5, 1e-3, 4)
COARSE = Fineness((8.0,), 2e-4, 0.1, 2)
"""For scalings from which a descent of the level starts: a fourth of the time of a fine fit."""
GROWING_SHARPNESS = 60.0
"""Exponent of the slope that says in which direction a new biquad is split."""
CURVATURE_SHARPNESS, LEAST_CURVATURE = 8.0, 1e-2
"""Exponent of the curvature at a fit, and its least eigenvalue, as a share of the largest."""
MOST_STEPS, LARGEST_STEP = 40, 2.0
"""Most Newton steps for one exponent, and the largest step in logarithms of parameters."""
FIRST_DAMPING = 1e-2
"""First Newton damping, as a share of the largest second derivative."""
DAMPING_FALL, DAMPING_RISE = 0.2, 6.0
"""Factors on the Newton damping after a step that fell as promised, and after one that rose."""
DAMPING_WEIGHT = 1e-4
"""Weight of the squared logarithms of damping ratios, which keeps them near 1 where the loop does
not need other values."""
SCALING_FIT_TOLERANCE = 5e-4
"""More biquads must lower the logarithm of the miss by more than this to be used."""
BIQUAD_SPLIT = 0.3
"""Distance, in log frequency, of a new biquad's zeros and poles from its place."""
LEAST_EIGENVALUE = 1e-100
"""Least eigenvalue used; zero rows and columns give eigenvalues 0 with infinite logarithms."""
EQUAL_EIGENVALUES = 1e-7
"""Relative distance of eigenvalues up to which a divided difference is computed as derivative."""


@dataclass(frozen=True, eq=False)
class ScalingFit:
    """Data to which scalings of the first blocks of a structure are fitted.

    ``M`` (F, n, n) is the response over the reference, made square by zeros. ``peak`` is the
    largest reference.
    """

    structure: Structure
    omega: RealArray
    M: Array
    peak: float
    fineness: Fineness

    @classmethod
    def of(
        cls,
        structure: Structure,
        omega: RealArray,
        M: Array,
        reference: RealArray,
        fineness: Fineness = FINE,
    ) -> ScalingFit:
        """The data from responses (F, c, r) at omega (F,) [rad/s] and a reference (F,)."""
        kept = _telling(M, fineness.change)
        M = M[kept] / reference[kept, None, None]
        n = max(M.shape[1:])
        square = np.zeros((len(M), n, n), complex)
        square[:, : M.shape[1], : M.shape[2]] = M
        return cls(structure, omega[kept], square, float(reference.max()), fineness)

    def missed(self, scalings: Scalings, x: RealArray) -> tuple[float, float]:
        """log of the worst sigma_max(D M D^-1) over the reference, and its frequency [rad/s]."""
        scaled = self._scaled(scalings.log_magnitude(x, self.omega)[0])
        size = np.linalg.svd(scaled, compute_uv=False)[:, 0]
        worst = int(np.argmax(size))
        return float(np.log(size[worst])), float(self.omega[worst])

    def grown(self, start: Fitted, omega: float) -> Fitted:
        """Scalings with one more biquad at omega [rad/s], split in the direction that helps."""
        scalings, x = start[0].grown(start[1], omega, np.zeros(start[0].rows))
        _, gradient, _ = self._cost(scalings, x.ravel(), GROWING_SHARPNESS)
        slope = gradient.reshape(x.shape)[:, start[0].size]
        return start[0].grown(start[1], omega, -BIQUAD_SPLIT * np.sign(slope))

    def curvature(self, scalings: Scalings, x: RealArray) -> RealArray:
        """A positive definite second derivative (n, n) of the smoothed maximum by the parameters.

        Its eigenvalues are the sizes of those of the true one, and not too small.
        """
        values, turn = np.linalg.eigh(self._cost(scalings, x.ravel(), CURVATURE_SHARPNESS)[2])
        size = np.abs(values)
        found: RealArray = (turn * np.maximum(size, LEAST_CURVATURE * size.max())) @ turn.T
        return found

    def near(self, scalings: Scalings, x: RealArray) -> RealArray:
        """The best parameters (blocks, P) found from x."""
        low, high = scalings.limits(self.omega[1:-1] if len(self.omega) > 2 else self.omega)
        flat = np.clip(x.ravel(), low, high)
        for sharpness in self.fineness.sharpness:
            flat = self._minimum(scalings, flat, sharpness, low, high)
        return flat.reshape(x.shape)

    def _minimum(
        self, scalings: Scalings, flat: RealArray, sharpness: float, low: RealArray, high: RealArray
    ) -> RealArray:
        """Minimise the cost within bounds by damped Newton steps."""
        value, gradient, hessian = self._cost(scalings, flat, sharpness)
        # D of a block that is decoupled has no effect at all
        damping = max(FIRST_DAMPING * float(np.abs(np.diag(hessian)).max()), EPS)
        for _ in range(MOST_STEPS):
            tick("fit of scalings")
            free = (flat > low) | (gradient < 0.0)
            free &= (flat < high) | (gradient > 0.0)
            curvature, turn = np.linalg.eigh(hessian[np.ix_(free, free)])
            step = np.zeros_like(flat)
            step[free] = -turn @ ((turn.T @ gradient[free]) / (np.abs(curvature) + damping))
            step *= min(1.0, LARGEST_STEP / max(float(np.abs(step).max(initial=0.0)), LARGEST_STEP))
            trial = np.clip(flat + step, low, high)
            step = trial - flat
            if -float(gradient @ step) < self.fineness.settled:
                break
            promised = -float(gradient @ step + step @ hessian @ step / 2)
            new = self._cost(scalings, trial, sharpness)
            fall = value - new[0]
            if not fall > 0.0:
                damping *= DAMPING_RISE
                continue
            if fall > promised / 2:
                damping *= DAMPING_FALL
            flat, (value, gradient, hessian) = trial, new
            if fall < self.fineness.settled:
                break
        return flat

    def _cost(
        self, scalings: Scalings, flat: RealArray, sharpness: float
    ) -> tuple[float, RealArray, RealArray]:
        """The smoothed maximum with its gradient and Hessian by the parameters."""
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
        plain = DAMPING_WEIGHT * scalings.dampings
        value += float(plain @ flat**2)
        return value, gradient + 2 * plain * flat, hessian + 2 * np.diag(plain)

    def _smoothed(self, log: RealArray, sharpness: float) -> tuple[float, RealArray, RealArray]:
        """log sum sigma^s / s with its first and second derivatives by log d.

        The first derivatives have shape (B, F). The second derivatives (B, B, F) are those of the
        sum at each frequency, over s times the total sum.

        Let X = Y^H Y have eigenvalues e, and f(e) = e^m with m = s / 2. In the basis of the
        eigenvectors of X, the second differential of sum f(e) is
        sum_jk f'[e_j, e_k] |dX_jk|^2 + sum_j f'(e_j) d2X_jj with f'(e) = m e^(m-1) and f'[.,.] its
        divided differences.
        """
        U, size, Vh = np.linalg.svd(self._scaled(log))
        m = sharpness / 2
        values = np.maximum(size**2, LEAST_EIGENVALUE)
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
        """D M D^-1 (F, n, n) for log d (B, F)."""
        rows, columns = diagonals(self.structure, log)
        scaled = self.M.copy()
        scaled[:, : rows.shape[1], : columns.shape[1]] *= np.exp(
            rows[:, :, None] - columns[:, None, :]
        )
        return scaled


def _products(left: Array, right: Array) -> RealArray:
    """Real parts (F, B, B) of the sums over entries of left_b conj(right_c), both (B, F, n, n)."""
    B, F = left.shape[:2]
    a, b = (np.moveaxis(one.reshape(B, F, -1), 0, 1) for one in (left, right))
    product: RealArray = (a @ b.conj().mT).real
    return product


def worth(fit: ScalingFit, start: Fitted) -> tuple[Fitted, float]:
    """Scalings with as few biquads as needed, and the logarithm of what they miss.

    The start may have no biquads. The biquad of the start that matters least is removed on trial.
    Then biquads are added one by one where the miss is largest, while this lowers the miss enough.
    """
    tried = [_near(fit, start)]
    (scalings, x), _, _ = tried[0]
    if scalings.biquads:
        fewer = [scalings.without(x, k) for k in range(scalings.biquads)]
        tried.append(_near(fit, min(fewer, key=lambda one: fit.missed(*one)[0])))
        tried.sort(key=lambda one: one[1])
    found, missed, at = tried[0]
    while missed > SCALING_FIT_TOLERANCE and found[0].biquads < fit.fineness.biquads:
        found, missed, at = _near(fit, fit.grown(found, at))
        tried.append((found, missed, at))
    least = min(missed for _, missed, _ in tried)
    good = [one for one in tried if one[1] <= least + SCALING_FIT_TOLERANCE]
    found, missed, _ = min(good, key=lambda one: (one[0][0].biquads, one[1]))
    return found, missed


def _near(fit: ScalingFit, start: Fitted) -> tuple[Fitted, float, float]:
    """The best scalings found from a start, their miss, and its frequency [rad/s]."""
    found = start[0], fit.near(*start)
    return found, *fit.missed(*found)


def _divided(values: RealArray, first: RealArray, m: float) -> RealArray:
    """Divided differences (F, n, n) of f' between eigenvalues (F, n); `first` is f' (F, n)."""
    a, b = values[:, :, None], values[:, None, :]
    near = np.abs(a - b) < EQUAL_EIGENVALUES * (a + b)
    with np.errstate(all="ignore"):
        apart = (first[:, :, None] - first[:, None, :]) / (a - b)
    same = (m - 1) * (first / values)
    return np.where(near, (same[:, :, None] + same[:, None, :]) / 2, apart)


def _telling(M: Array, change: float) -> NDArray[np.bool_]:
    """Mark both ends and the frequencies at which the response differs from the last one marked.

    It differs if its largest change is more than the share `change` of its largest entry.
    """
    kept = np.zeros(len(M), dtype=bool)
    kept[[0, -1]] = True
    last = M[0]
    for k, one in enumerate(M):
        if np.abs(one - last).max() > change * np.abs(last).max():
            kept[k], last = True, one
    return kept
