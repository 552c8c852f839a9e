"""Iteration steps that keep known static gains: along their surface, and back onto it."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.knowledge import Knowledge


class GainSurface:
    """The set of a criterion's parameters whose models have the known gains.

    ``known`` is in the units of the criterion's record.
    """

    def __init__(self, criterion: Criterion, known: Knowledge) -> None:
        self._criterion, self._known = criterion, known

    def _error(self, theta: RealArray) -> tuple[RealArray, RealArray]:
        """Errors (q,) of the gains, and their derivatives (q, P) with respect to the parameters."""
        errors, slopes = self._known.gain_error(self._criterion.model(theta))
        return errors, self._criterion.by_parameters(slopes, len(theta))

    def tangent(self, theta: RealArray, scale: RealArray) -> RealArray:
        """Orthonormal columns (P, P - q) that keep the gains to first order.

        They are directions of the scaled parameters, theta times the scale (P,).
        """
        slopes = self._error(theta)[1] / scale
        return np.asarray(np.linalg.qr(slopes.T, mode="complete")[0][:, len(slopes) :])

    def nearest(self, theta: RealArray) -> RealArray:
        """Parameters with the known gains, by the least change of B and D, which enter linearly.

        The second correction removes the rounding of the first.
        """
        linear = self._criterion.of_inputs
        for _ in range(2):
            errors, slopes = self._error(theta)
            if not (np.isfinite(errors).all() and np.isfinite(slopes).all()):
                return theta
            change = np.linalg.lstsq(slopes[:, linear], errors, rcond=None)[0]
            theta = theta.copy()
            theta[linear] -= change
        return theta
