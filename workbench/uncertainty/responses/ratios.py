"""Responses that are ratios of two estimates, such as those of plants in closed loops."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification.responses.ratios import of_chosen, ratio_reach


@dataclass(frozen=True, eq=False)
class Ratios:
    """Joint covariances of N responses y / u at F frequencies, for Fieller's regions.

    Parameters
    ----------
    joint
        Covariances (F, N, 2, 2) of the errors of y and u, divided by |u|^2.
    chosen
        Share (N,) of the frequency lines that were chosen because u is significant there.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty.responses.ratios import Ratios
    >>> ratios = Ratios(np.full((1, 1, 2, 2), 0.01 + 0j) * np.eye(2), np.ones(1))
    >>> float(ratios.radius(np.array([[1 + 0j]]), np.array([40.0]), 0.95)[0, 0].round(3))
    0.283
    """

    joint: ComplexArray
    chosen: RealArray

    def at(self, chosen: np.ndarray) -> Ratios:
        """The covariances at some of the frequencies, by index."""
        return replace(self, joint=self.joint[chosen])

    def radius(self, values: ComplexArray, degrees: RealArray, confidence: float) -> RealArray:
        """Radii (F, N) of the discs around the ratios that contain the true ones; some are
        infinite.
        """
        return ratio_reach(values, self.joint, degrees, of_chosen(confidence, self.chosen))

    def scaled(self, factor: ComplexArray) -> Ratios:
        """The covariances for the responses times factors (F,)."""
        sides = np.stack([factor, np.ones_like(factor)], axis=-1)[:, None]
        return replace(self, joint=self.joint * sides[..., :, None] * sides[..., None, :].conj())

    def with_numerator(self, variance: RealArray) -> Ratios:
        """The covariances with an additional variance (F, N) of y, divided by |u|^2."""
        joint = self.joint.copy()
        joint[..., 0, 0] += variance
        return replace(self, joint=joint)
