"""Search for the highest level of mu with a dual certificate, by bisection and cone programs."""

from __future__ import annotations

import numpy as np

from workbench.errors import SolverError
from workbench.executor import Context
from workbench.geometry import smallest_circle
from workbench.geometry.circle import Circle
from workbench.solvers import Options, conic_solvers, solve_conic
from workbench.synthesis.limits.allowed_sets import allowed_points
from workbench.synthesis.limits.analytic_basis import AnalyticBasis
from workbench.synthesis.limits.dual_bound import DualCertificate
from workbench.synthesis.limits.loop_functions import LoopFunctions
from workbench.synthesis.limits.rational_bounds import FrequencyCells

PARTS = 300
"""Number of frequencies on which h is sought."""
BISECTION_LEVELS = 8
"""Number of levels of mu tried by bisection."""
SOLVER_ACCURACY = 1e-5
"""Accuracy asked of the solver. It need not be fine, since any h that proves the level is good."""


def highest_certificate(
    loop: LoopFunctions, basis: AnalyticBasis, low: float, high: float, context: Context
) -> DualCertificate | None:
    """The certificate with the highest level found between `low` and `high`; None if none was
    found.

    No stabilising linear time-invariant controller, rational or not, has mu at or below the
    certificate's level at every frequency. The conditions on the loop are those of
    `DualCertificate.excess`.

    Parameters
    ----------
    loop
        The loop's weights. With `LoopFunctions.nominal` the bound is that of the nominal plant.
    basis
        Functions whose sum is h. With the plant's zeros and poles in the right half-plane the bound
        is sharper.
    low, high
        Positive levels between which the search takes place.

    Raises
    ------
    InputError
        As `DualCertificate.excess`.
    SolverError
        The solver gives no answer for a level.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.executor import Context
    >>> from workbench.fitting import Rational
    >>> from workbench.synthesis import AnalyticBasis, LoopFunctions, highest_certificate
    >>> loop = LoopFunctions(Rational([], [], 0.1), Rational([], [], 1.0), Rational([], [1.0], 1.0))
    >>> basis = AnalyticBasis(np.geomspace(0.05, 20.0, 12), (1e-3, 1e3), poles=[1.0])
    >>> found = highest_certificate(loop, basis, 1.0, 3.0, Context())
    >>> 1.8 < found.level < 2.01  # 1 / (s - 1) needs |K S| of 2
    True
    """
    best = None
    for _ in range(BISECTION_LEVELS):
        level = float(np.sqrt(low * high))
        found = dual_candidate(loop, basis, level, context)
        if found.excess(loop) < 0.0:
            best, low = found, level
        else:
            high = level
    return best


def dual_candidate(
    loop: LoopFunctions, basis: AnalyticBasis, level: float, context: Context
) -> DualCertificate:
    """The h with the least integral of Re(c h) while the integral of R |h| is at most 1.

    c and R are centres and radii of circles around the sets of allowed T. If a set is empty, any h
    proves the level, and h = 0 is returned. Raises SolverError if the solver finds no h.
    """
    import cvxpy as cp

    omega, width = basis.midpoints(PARTS)
    points = allowed_points(loop.over(FrequencyCells(omega, omega)), level)
    if np.isnan(points).all(axis=1).any():
        return DualCertificate(level, np.zeros(basis.size), basis)
    circle = _circles(points)
    h = basis.response(omega)
    x = cp.Variable(basis.size)
    along = ((width * circle.center) @ h).real - np.pi * basis.known
    around = (width * circle.radius)[:, None] * h
    sizes = cp.norm(cp.vstack([around.real @ x, around.imag @ x]), 2, axis=0)
    problem = cp.Problem(cp.Minimize(along @ x), [cp.sum(sizes) <= 1])
    outcome, said = solve_conic(
        problem, conic_solvers()[0], Options(tolerance=SOLVER_ACCURACY), context
    )
    if x.value is None:
        raise SolverError(f"no h for the level {level:.6g}: {outcome}, {said}")
    return DualCertificate(level, np.asarray(x.value, dtype=float), basis)


def _circles(points: np.ndarray) -> Circle:
    """Smallest circles around points (F, N); points that are NaN are ignored."""
    missing = np.isnan(points)
    one = np.take_along_axis(points, missing.argmin(axis=1)[:, None], axis=1)
    return smallest_circle(np.where(missing, one, points))
