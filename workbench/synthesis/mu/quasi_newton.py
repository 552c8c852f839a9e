"""Damped BFGS update of a Hessian, M. J. D. Powell, Lecture Notes in Mathematics 630 (1978) 144."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray

KEPT_CURVATURE = 0.2
"""Least share of the old curvature along a step that an update must keep."""


def updated_hessian(hessian: RealArray, step: RealArray, change: RealArray) -> RealArray:
    """The positive definite update for a step (n,) and the change of the gradient (n,)."""
    along = hessian @ step
    curved, seen = float(step @ along), float(step @ change)
    if curved <= 0.0:
        return np.outer(change, change) / seen if seen > 0 else hessian
    share = (
        1.0 if seen >= KEPT_CURVATURE * curved else (1 - KEPT_CURVATURE) * curved / (curved - seen)
    )
    blend = share * change + (1 - share) * along
    update: RealArray = (
        np.outer(blend, blend) / float(step @ blend) - np.outer(along, along) / curved
    )
    return hessian + update
