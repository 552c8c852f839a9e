"""Least squares over frequency: the member of a family nearest to a response."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray

MOST_EVALUATIONS = 200
"""Largest number of evaluations in a descent."""
NO_SHARE = 1e-9
"""A contribution to a sum below this share of the largest one is rounding and is set to 0."""
MOST_MOVED = 20.0
"""Largest change of a parameter during the descent, for parameters of about one and logarithms."""


def combined(
    basis: ComplexArray, wanted: ComplexArray, weight: RealArray
) -> tuple[RealArray, float]:
    """Real coefficients (k,) with which a sum of responses (F, k, p, m) is nearest to one (F, p,
    m).

    Returns the coefficients and the remaining weighted distance.
    """
    count = basis.shape[1]
    columns = (weight[:, None, None, None] * basis).swapaxes(0, 1).reshape(count, -1)
    right = (weight[:, None, None] * wanted).ravel()
    size = np.maximum(np.linalg.norm(columns, axis=1), np.finfo(float).tiny)
    rows = np.hstack([columns.real, columns.imag]) / size[:, None]
    sides = np.concatenate([right.real, right.imag])
    found = np.linalg.lstsq(rows.T, sides, rcond=None)[0]
    found[np.abs(found) <= NO_SHARE * np.abs(found).max(initial=0.0)] = 0.0
    return found / size, float(np.linalg.norm(rows.T @ found - sides))


def fitted_parameters(
    response: Callable[[RealArray, RealArray], tuple[ComplexArray, ComplexArray]],
    x: RealArray,
    wanted: ComplexArray,
    omega: RealArray,
    weight: RealArray,
) -> tuple[RealArray, float]:
    """Parameters near x whose response is nearest to `wanted` (F, p, m), and the remaining
    distance.
    """
    from scipy.optimize import least_squares

    scale = np.linalg.norm(weight[:, None, None] * wanted) or 1.0

    def parts(values: ComplexArray) -> RealArray:
        values = values / scale
        return np.concatenate([values.real.ravel(), values.imag.ravel()])

    def missed(y: RealArray) -> RealArray:
        return parts(weight[:, None, None] * (response(y, omega)[0] - wanted))

    def slopes(y: RealArray) -> RealArray:
        each = weight[:, None, None, None] * response(y, omega)[1]
        return np.stack([parts(each[:, k]) for k in range(len(y))], axis=1)

    room = MOST_MOVED * np.maximum(np.abs(x), 1.0)
    found = least_squares(
        missed, x, slopes, (x - room, x + room), x_scale="jac", max_nfev=MOST_EVALUATIONS
    )
    return found.x, float(np.sqrt(2.0 * found.cost)) * float(scale)
