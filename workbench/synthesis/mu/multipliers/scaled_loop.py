"""The bound that scalings prove for a loop, its derivatives by their parameters, and a penalty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.synthesis.mu.multipliers import triangles
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.synthesis.mu.multipliers.scaled_bound import ScaledBound, scaled_bound

DAMPING_WEIGHT, DISTANCE_WEIGHT = 1e-4, 1e-5
"""Weights in the penalty: of squared logarithms of damping ratios, and of ratios of zeros to poles.
They keep both near 1 if the loop does not need other values.
"""
FREE_PHASE, LARGEST_PHASE, PHASE_WEIGHT = 1.5, 1.565, 300.0
"""Largest |arg m| [rad] without a penalty, largest |arg m| allowed, and weight of the mean square
excess over the first one.
"""


@dataclass(frozen=True, eq=False)
class ScaledLoop:
    """A loop with scalings that have parameters ``x``, and the derivatives of the scalings.

    Unlike a closed `StateSpace`, it has the derivatives of its scaled response.

    ``log_d`` (channels, F) is log d, ``phase`` (k, F) is arg m of the real channels, and
    ``entries`` holds the entries of T. Their derivatives by x, each of shape (rows, P, F), are
    ``functions_by_x`` of the logarithms of d, m_+ and m_-, ``phases_by_x`` of the phases of m_+ and
    m_-~, and ``entries_by_x``.
    """

    scalings: Multipliers
    x: RealArray
    log_d: RealArray
    functions_by_x: RealArray
    phase: RealArray
    phases_by_x: RealArray
    entries: Array
    entries_by_x: Array
    bound: ScaledBound

    @classmethod
    def of(cls, scalings: Multipliers, M: Array, omega: RealArray, x: RealArray) -> ScaledLoop:
        """The loop with response M (F, c, r) at omega (F,) [rad/s]."""
        functions, channels = scalings.functions, scalings.channels
        plus, into, out = scalings.real
        log_d, functions_by_x = functions.log_magnitude(x[: functions.rows], omega)
        first, first_by_x = functions.phase(x[plus], omega)
        second, second_by_x = functions.phase(x[scalings.minus], omega)
        phase = first - second
        theta = np.clip(phase, -LARGEST_PHASE, LARGEST_PHASE)
        # D^2 = |m| cos(arg m); the gain parameter is that of D
        log_d[plus] += log_d[scalings.minus] + x[plus, :1] + np.log(np.cos(theta))
        log_d[plus] /= 2
        log_d = log_d[:channels]
        entries, entries_by_x = triangles.responses(x[functions.rows :], omega)
        Y = _scaled_response(scalings, M, log_d, x[:channels, 0], entries)
        return cls(
            scalings,
            x,
            log_d,
            functions_by_x,
            phase,
            np.concatenate([first_by_x, -second_by_x]),
            entries,
            entries_by_x,
            scaled_bound(Y, np.tan(theta).T, into, out),
        )

    @property
    def log_beta(self) -> RealArray:
        """Logarithm of the bound (F,)."""
        return np.log(self.bound.beta)

    def slope(self, weight: RealArray) -> RealArray:
        """Derivatives (rows, P) of the sum of log beta with weights (F,)."""
        scalings, bound = self.scalings, self.bound
        by_d, by_gain = np.empty_like(self.log_d), np.empty(scalings.channels)
        by_entry = np.empty_like(self.entries)
        for n, at, beside, row, column in scalings.places:
            if n == 1:
                by_d[at] = bound.trace(row, column)
                by_gain[at] = by_d[at] @ weight
                continue
            change = bound.change(row, column)
            by_d[at] = np.diagonal(change, axis1=1, axis2=2).real.T
            d = np.exp(self.log_d[at] - self.x[at, :1]).T
            change = change * d[:, None, :] / d[:, :, None]
            by_T, by_entry[beside] = triangles.change(self.entries[beside], n, change)
            by_gain[at] = weight @ np.diagonal(by_T, axis1=1, axis2=2).real
        plus = scalings.real[0]
        F = np.tan(np.clip(self.phase, -LARGEST_PHASE, LARGEST_PHASE))
        by_phase = bound.by_turn.T * (1 + F**2) - F * by_d[plus] / 2
        by_phase *= np.abs(self.phase) < LARGEST_PHASE
        by_d[plus] /= 2  # d is the square root of |m|
        functions, total = scalings.functions.rows, np.empty_like(self.x)
        total[:functions] = _weighted_sum(
            np.concatenate([by_d, by_d[plus]]) * weight, self.functions_by_x
        )
        total[functions:] = _weighted_sum(by_entry * weight, self.entries_by_x)
        self._add_phases(total, by_phase * weight)
        total[: scalings.channels, 0], total[scalings.minus, 0] = by_gain, 0.0
        return total

    def price(self) -> tuple[float, RealArray]:
        """Penalty on dampings, distances and phases near a right angle, and its derivatives (rows,
        P).
        """
        x, functions = self.x, self.scalings.functions.rows
        slope = np.zeros_like(x)
        slope[:functions, 2::2] = 2 * DAMPING_WEIGHT * x[:functions, 2::2]
        slope[functions:, 2::4] = 2 * DAMPING_WEIGHT * x[functions:, 2::4]
        distance = x[:functions, 1::4] - x[:functions, 3::4]
        slope[:functions, 1::4] += 2 * DISTANCE_WEIGHT * distance
        slope[:functions, 3::4] -= 2 * DISTANCE_WEIGHT * distance
        price = float(np.sum(slope * x)) / 2  # up to here a quadratic form
        if self.phase.size:
            excess = np.maximum(np.abs(self.phase) - FREE_PHASE, 0.0)
            price += PHASE_WEIGHT * float(np.mean(excess**2))
            self._add_phases(slope, 2 * PHASE_WEIGHT * excess * np.sign(self.phase) / excess.size)
        return price, slope

    def _add_phases(self, slope: RealArray, by_phase: RealArray) -> None:
        """Add to the slopes (rows, P) those through arg m, from the slopes by arg m (k, F)."""
        turned = _weighted_sum(np.concatenate([by_phase, by_phase]), self.phases_by_x)
        slope[self.scalings.real[0]] += turned[: len(by_phase)]
        slope[self.scalings.minus] += turned[len(by_phase) :]


def _scaled_response(
    scalings: Multipliers, M: Array, log_d: RealArray, gains: RealArray, entries: Array
) -> Array:
    """D M D^-1 (F, c, r)."""
    rows = np.zeros((len(M), M.shape[1]))
    columns = np.zeros((len(M), M.shape[2]))
    for n, at, _, row, column in scalings.places:
        rows[:, row] = columns[:, column] = log_d[at].T if n == 1 else gains[at]
    Y: Array = np.exp(rows)[:, :, None] * M * np.exp(-columns)[:, None, :]
    for n, at, beside, row, column in scalings.places:
        if n > 1:
            U, L = triangles.triangular_factors(entries[beside], n)
            T = np.exp(log_d[at] - gains[at, None]).T[:, :, None] * (U @ L)
            Y[:, row] = T @ Y[:, row]
            Y[:, :, column] = Y[:, :, column] @ np.linalg.inv(T)
    return Y


def _weighted_sum(by: Array, slopes: Array) -> RealArray:
    """Real parts of the sums over frequency of (rows, F) times (rows, P, F)."""
    return np.asarray(np.einsum("bf,bpf->bp", by, slopes).real)
