"""Steps of a search that end where poles of the plant and of its predictor may lie.

The best model often has a pole on its limit. The predictor of an integrator with stationary noise
at its output has a pole on the unit circle, and its plant has one there too. A search that only
shortens the steps which leave the limits stops at the first that it meets, far from the minimum.

Source: D. Bertsekas, "Projected Newton methods for optimization problems with simple constraints",
SIAM Journal on Control and Optimization 20(2), 1982 (a step is projected in the metric of the
curvature, so that it goes on along a limit).
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.model import InnovationsModel

CIRCLE_ROUNDING = 1e-10
"""Accuracy of computed eigenvalues near the unit circle."""
PROJECTIONS = 6
"""Most projections of a step; each corrects the curvature of a limit that the last one left."""
INSIDE = 1e-9
"""Distance from a limit to which a step is projected."""


class PoleLimits:
    """Largest moduli of a model's poles and of its predictor's, for parameters of a criterion."""

    def __init__(self, criterion: Criterion, largest_radius: float) -> None:
        self._criterion, self._largest = criterion, largest_radius

    def hold(self, model: InnovationsModel) -> bool:
        """Whether all poles are within the limits."""
        return model.predictor_radius < 1 - CIRCLE_ROUNDING and model.radius <= self._largest

    def projected(self, theta: RealArray, covariance: RealArray) -> RealArray:
        """The parameters (P,) within the limits that are nearest in the metric of a covariance.

        To first order; where a limit bends much, the result is still outside.
        """
        for _ in range(PROJECTIONS):
            model = self._criterion.model(theta)
            if not np.isfinite(model.A - model.K @ model.C).all():
                return theta
            if self.hold(model):
                return theta
            excess, slopes = self._beyond(model)
            slopes = self._criterion.by_parameters(slopes, len(theta))
            along = covariance @ slopes.T
            theta = theta - along @ np.linalg.lstsq(slopes @ along, excess, rcond=None)[0]
        return theta

    def _beyond(self, m: InnovationsModel) -> tuple[RealArray, RealArray]:
        """By how much poles (q,) are beyond their limits, and the slopes (q, entries) of this.

        The entries are those of A, B, C, D, K and both offsets, row by row.
        """
        excess, slopes = [], []
        plant, predictor = (m.A, self._largest), (m.A - m.K @ m.C, 1 - CIRCLE_ROUNDING)
        for matrix, limit in (plant, predictor):
            values, right = np.linalg.eig(matrix)
            left = np.linalg.pinv(right)
            for k in np.flatnonzero((np.abs(values) > limit - INSIDE / 2) & (values.imag >= 0)):
                v, w = right[:, k], left[k] * values[k].conj() / np.abs(values[k])
                fed = float(matrix is not m.A)
                by_C, by_K = -fed * np.outer(w @ m.K, v), -fed * np.outer(w, m.C @ v)
                parts = (
                    np.outer(w, v), 0 * m.B, by_C, 0 * m.D, by_K, 0 * m.u_offset, 0 * m.y_offset,
                )  # fmt: skip
                excess.append(np.abs(values[k]) - limit + INSIDE)
                slopes.append(np.concatenate([part.real.ravel() for part in parts]))
        return np.array(excess), np.array(slopes)
