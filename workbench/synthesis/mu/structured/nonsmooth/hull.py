"""The shortest vector in the convex hull of gradients: steepest descent direction and measure of
stationarity.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from workbench._core.arrays import RealArray


def least_in_hull(gradients: RealArray) -> RealArray:
    """The shortest vector (k,) in the convex hull of the rows of gradients (G, k).

    Nonnegative weights w that minimise |sum w g|^2 + (1 - sum w)^2 give its direction: for each
    direction the best length gives |g|^2 / (1 + |g|^2), which grows with |g|.
    """
    size = float(np.abs(gradients).max(initial=0.0))
    if not size:
        return np.zeros(gradients.shape[1])
    rows = np.vstack([gradients.T / size, np.ones(len(gradients))])
    weights, _ = nnls(rows, np.append(np.zeros(gradients.shape[1]), 1.0))
    found: RealArray = weights / weights.sum() @ gradients
    return found
