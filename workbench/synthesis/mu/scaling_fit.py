"""Fit of scalings to a loop: minimise the worst ratio of sigma_max(D M D^-1) to a reference.

The maximum over frequency is replaced by the smooth log sum (sigma_j / reference)^s / s over all
singular values and frequencies, with increasing s. The sum at each frequency is convex in the
logarithms of D and has a second derivative in closed form, that of a trace function. So Newton's
method needs tens of steps, while gradient methods need hundreds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench._core.arrays import EPS, Array, RealArray
from workbench.executor.clock import tick
from workbench.structure import Structure
from workbench.synthesis.mu.biquads import Biquads

Fitted = tuple[Biquads, RealArray]
"""The scalings, and their parameters (blocks, P)."""


class Fineness(NamedTuple):
    """Settings for the accuracy of a fit of scalings.

    ``sharpness`` holds the exponents s; the fit for each one starts from the minimum of the one
    before. A fit ends when a step is predicted to lower, or lowers, the logarithm by less than
    ``settled``. A frequency is left out if the response has changed by less than the share
    ``change`` since the last one. ``biquads`` is the largest number of biquads of a scaling.
    """

    sharpness: tuple[float, ...]
    settled: float
    change: float
    biquads: int


FINE = Fineness((8.0, 60.0, 400.0), 2e-5, 1e-3, 4)
COARSE = Fineness((8.0,), 2e-4, 0.1, 2)
"""Settings for scalings from which a descent of the level starts; they need a quarter of the time
of a fine fit.
"""
GROWING_SHARPNESS = 60.0
"""Exponent for the slope that decides in which direction a new biquad is split."""
CURVATURE_SHARPNESS, LEAST_CURVATURE = 8.0, 1e-2
"""Exponent for the curvature at a fit, and its least eigenvalue relative to the largest."""
MOST_STEPS, LARGEST_STEP = 40, 2.0
"""Largest number of Newton steps for one exponent, and largest step in logarithms of parameters."""
FIRST_DAMPING = 1e-2
"""Initial Newton damping, relative to the largest second derivative."""
DAMPING_FALL, DAMPING_RISE = 0.2, 6.0
"""Factors on the Newton damping after a step that decreased the cost as predicted, and after one
that increased it.
"""
DAMPING_WEIGHT = 1e-4
"""Weight of the squared logarithms of damping ratios. It keeps the ratios near 1 if the loop does
not need other values.
"""
SCALING_FIT_TOLERANCE = 5e-4
"""More biquads are used only if they lower the logarithm of the miss by more than this."""
BIQUAD_SPLIT = 0.3
"""Distance, in log frequency, of a new biquad's zeros and poles from its centre."""
LEAST_EIGENVALUE = 1e-100
"""Least eigenvalue used. Zero rows and columns have eigenvalues 0, whose logarithms are
infinite.
"""
EQUAL_EIGENVALUES = 1e-7
"""For eigenvalues within this relative distance, a divided difference is computed as a
derivative.
"""


@dataclass(frozen=True, eq=False)
class ScalingFit:
    """Data to which scalings of the first blocks of a structure are fitted.

    ``M`` (F, n, n) is the response divided by the reference, padded with zeros to square matrices.
    ``peak`` is the largest reference.
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
        kept = _informative_frequencies(M, fineness.change)
        M = M[kept] / reference[kept, None, None]
        n = max(M.shape[1:])
        square = np.zeros((len(M), n, n), complex)
        square[:, : M.shape[1], : M.shape[2]] = M
        return cls(structure, omega[kept], square, float(reference.max()), fineness)

    def missed(self, scalings: Biquads, x: RealArray) -> tuple[float, float]:
        """Logarithm of the worst ratio of sigma_max(D M D^-1) to the reference, and its frequency
        [rad/s].
        """
        scaled = self._scaled_response(scalings.log_magnitude(x, self.omega)[0])
        size = np.linalg.svd(scaled, compute_uv=False)[:, 0]
        worst = int(np.argmax(size))
        return float(np.log(size[worst])), float(self.omega[worst])

    def grown(self, start: Fitted, omega: float) -> Fitted:
        """Scalings with one more biquad at omega [rad/s], split in the direction that helps."""
        scalings, x = start[0].grown(start[1], omega, np.zeros(start[0].rows))
        _, gradient, _ = self._cost(scalings, x.ravel(), GROWING_SHARPNESS)
        slope = gradient.reshape(x.shape)[:, start[0].size]
        return start[0].grown(start[1], omega, -BIQUAD_SPLIT * np.sign(slope))

    def curvature(self, scalings: Biquads, x: RealArray) -> RealArray:
        """A positive definite second derivative (n, n) of the smoothed maximum by the parameters.

        Its eigenvalues are the magnitudes of those of the true second derivative, limited from
        below.
        """
        values, turn = np.linalg.eigh(self._cost(scalings, x.ravel(), CURVATURE_SHARPNESS)[2])
        size = np.abs(values)
        found: RealArray = (turn * np.maximum(size, LEAST_CURVATURE * size.max())) @ turn.T
        return found

    def near(self, scalings: Biquads, x: RealArray) -> RealArray:
        """The best parameters (blocks, P) found from x."""
        low, high = scalings.limits(self.omega[1:-1] if len(self.omega) > 2 else self.omega)
        flat = np.clip(x.ravel(), low, high)
        for sharpness in self.fineness.sharpness:
            flat = self._minimum(scalings, flat, sharpness, low, high)
        return flat.reshape(x.shape)

    def _minimum(
        self, scalings: Biquads, flat: RealArray, sharpness: float, low: RealArray, high: RealArray
    ) -> RealArray:
        """Minimise the cost within bounds by damped Newton steps."""
        value, gradient, hessian = self._cost(scalings, flat, sharpness)
        # D of a decoupled block has no effect
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
        self, scalings: Biquads, flat: RealArray, sharpness: float
    ) -> tuple[float, RealArray, RealArray]:
        """The smoothed maximum with its gradient and Hessian by the parameters."""
        x = flat.reshape(scalings.rows, scalings.size)
        log, slope = scalings.log_magnitude(x, self.omega)
        value, by_log, bent = self._smooth_maximum(log, sharpness)
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

    def _smooth_maximum(
        self, log: RealArray, sharpness: float
    ) -> tuple[float, RealArray, RealArray]:
        """log sum sigma^s / s with its first and second derivatives by log d.

        The first derivatives have shape (B, F). The second derivatives (B, B, F) are those of the
        sum at each frequency, over s times the total sum.

        Let X = Y^H Y have eigenvalues e, and f(e) = e^m with m = s / 2. In the basis of the
        eigenvectors of X, the second differential of sum f(e) is
        sum_jk f'[e_j, e_k] |dX_jk|^2 + sum_j f'(e_j) d2X_jj with f'(e) = m e^(m-1) and f'[.,.] its
        divided differences.
        """
        U, size, Vh = np.linalg.svd(self._scaled_response(log))
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
        bent = _products(_divided_differences(values, first, m) * dX, dX)
        bent -= _products(2 * first[:, :, None] * C, dX)
        bent -= _products(4 * first[:, :, None] * Z, C)
        own = np.arange(len(log))
        bent[:, own, own] += 4 * (first * np.diagonal(Z, 0, 2, 3).real).sum(axis=-1).T
        bent = bent.transpose(1, 2, 0) / sharpness
        return value, slopes, bent

    def _scaled_response(self, log: RealArray) -> Array:
        """The scaled response D M D^-1 (F, n, n) for log d (B, F)."""
        rows, columns = diagonals(self.structure, log)
        scaled = self.M.copy()
        scaled[:, : rows.shape[1], : columns.shape[1]] *= np.exp(
            rows[:, :, None] - columns[:, None, :]
        )
        return scaled


def _products(left: Array, right: Array) -> RealArray:
    """Real parts (F, B, B) of the sums over entries of left_b conj(right_c), for (B, F, n, n)
    each.
    """
    B, F = left.shape[:2]
    a, b = (np.moveaxis(one.reshape(B, F, -1), 0, 1) for one in (left, right))
    product: RealArray = (a @ b.conj().mT).real
    return product


def worth(fit: ScalingFit, start: Fitted) -> tuple[Fitted, float]:
    """Scalings with as few biquads as needed, and the logarithm of their miss.

    The start may have no biquads. First the least important biquad of the start is removed on
    trial. Then biquads are added one by one where the miss is largest, as long as this lowers the
    miss enough.
    """
    tried = [_best_from(fit, start)]
    (scalings, x), _, _ = tried[0]
    if scalings.biquads:
        fewer = [scalings.without(x, k) for k in range(scalings.biquads)]
        tried.append(_best_from(fit, min(fewer, key=lambda one: fit.missed(*one)[0])))
        tried.sort(key=lambda one: one[1])
    found, missed, at = tried[0]
    while missed > SCALING_FIT_TOLERANCE and found[0].biquads < fit.fineness.biquads:
        found, missed, at = _best_from(fit, fit.grown(found, at))
        tried.append((found, missed, at))
    least = min(missed for _, missed, _ in tried)
    good = [one for one in tried if one[1] <= least + SCALING_FIT_TOLERANCE]
    found, missed, _ = min(good, key=lambda one: (one[0][0].biquads, one[1]))
    return found, missed


def _best_from(fit: ScalingFit, start: Fitted) -> tuple[Fitted, float, float]:
    """The best scalings found from a start, their miss, and its frequency [rad/s]."""
    found = start[0], fit.near(*start)
    return found, *fit.missed(*found)


def _divided_differences(values: RealArray, first: RealArray, m: float) -> RealArray:
    """Divided differences (F, n, n) of f' between eigenvalues (F, n); `first` is f' (F, n)."""
    a, b = values[:, :, None], values[:, None, :]
    near = np.abs(a - b) < EQUAL_EIGENVALUES * (a + b)
    with np.errstate(all="ignore"):
        apart = (first[:, :, None] - first[:, None, :]) / (a - b)
    same = (m - 1) * (first / values)
    return np.where(near, (same[:, :, None] + same[:, None, :]) / 2, apart)


def _informative_frequencies(M: Array, change: float) -> NDArray[np.bool_]:
    """Mask of both ends and of the frequencies where the response differs from that at the last
    marked one.

    It differs if the largest change of an entry is more than the share `change` of the largest
    entry.
    """
    kept = np.zeros(len(M), dtype=bool)
    kept[[0, -1]] = True
    last = M[0]
    for k, one in enumerate(M):
        if np.abs(one - last).max() > change * np.abs(last).max():
            kept[k], last = True, one
    return kept


def diagonals(structure: Structure, value: RealArray) -> tuple[RealArray, RealArray]:
    """Values (B, F) of the first B blocks, spread to rows (F, c) and columns (F, r); 0 for other
    blocks.
    """
    rows = np.zeros((value.shape[1], structure.columns))
    columns = np.zeros((value.shape[1], structure.rows))
    places = zip(value, structure.column_slices, structure.row_slices, strict=False)
    for one, row, column in places:
        rows[:, row], columns[:, column] = one[:, None], one[:, None]
    return rows, columns
