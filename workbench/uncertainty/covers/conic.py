"""The numerator of a nominal with given poles and the smallest sets, by second-order cone programs.

With the poles of the nominal that fits the centres, the nominal N is linear in its numerator. If
deviations are relative to a known nominal N0 (1 for additive models), the mean square size

    sum share_f (rho_f^2 + HALF_LENGTH_WEIGHT lambda_f^2),
    |G_fi - N_f - s_fi e_f| <= rho_f |N0_f|,    |s_fi| <= lambda_f |N0_f|,

is convex in N, in the radii rho, in the half-lengths lambda and in the positions s along the
directions e of the third set; circles have no lambda and no s. N0 is the nominal of the previous
round, as in the iteration of C. Sanathanan and J. Koerner, IEEE Trans. Automatic Control 8 (1963)
56-58.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.fitting.response.numerator import NumeratorBasis, with_numerator
from workbench.program import Claim, conic_method
from workbench.solvers import ConicSolver, Outcome, solve_conic
from workbench.uncertainty.covers.circle_cover import CircleCover
from workbench.uncertainty.covers.cover import HALF_LENGTH_WEIGHT, UncertaintyCover
from workbench.uncertainty.covers.finish import fitted_cover
from workbench.uncertainty.covers.nominal import nominal_fit
from workbench.uncertainty.covers.sets import outermost
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.weights import fitted

MOST_FREQUENCIES = 100
"""Largest number of frequencies of the cone program. It limits time and memory. With half of them
resonances between them are fitted less well; double takes more than twice as long. The cover is
raised at all frequencies afterwards.
"""
ROUNDS = 3
"""Number of rounds; each one uses deviations relative to the nominal of the round before. Each
leaves the nominal nearer to the one about which deviations are taken. Half leaves weights about an
older nominal; double costs time.
"""


def _given(program: UncertaintyCover) -> str | None:
    """The reason why there is no numerator to choose; None if there is one."""
    return "the nominal is given; take steps or joint" if program.nominal is not None else None


@conic_method(CircleCover, cones="second-order", optimal=False, unfit=_given)
@conic_method(StadiumCover, cones="second-order", optimal=False, unfit=_given)
def _conic(program: UncertaintyCover, context: Context, solver: ConicSolver) -> Claim:
    """Numerator of the nominal for small sets by cone programs, with the poles of "steps"."""
    first = program.first_set(program.points)
    nominal = fitted(nominal_fit(first.center, first, program), context)
    coarse, said = program.thinned(MOST_FREQUENCIES), ""
    try:
        for _ in context.track(range(ROUNDS), "cone programs"):
            nominal, said = _best_numerator(coarse, nominal, context, solver)
    except SolverError as error:
        return None, Outcome.FAILED, str(error)
    nominal = program.realisable(nominal)
    third = program.third_set(program.deviations_from(nominal, program.points))
    W_r = program.real_weight(third, context)
    return fitted_cover(program, first, nominal, third, W_r, context), Outcome.SOLVED, said


def _best_numerator(
    program: UncertaintyCover, near: Rational, context: Context, solver: ConicSolver
) -> tuple[Rational, str]:
    """The nominal with the poles of `near`, where sizes are relative to `near`, and a message.

    Raises SolverError if the solver gives no answer.
    """
    import cvxpy as cp

    omega, shares = program.responses.axis, program.responses.shares
    points, response = outermost(program.points), near.response(omega)
    unit = np.abs(response) if program.form == "multiplicative" else program.unit
    scale = float(np.sqrt(omega[0] * omega[-1]))
    basis = NumeratorBasis.over(omega / scale, 1 / unit, near.poles / scale, program.zeros)
    with context.stating():
        count = omega.size
        shape = cp.Variable(basis.columns.shape[1])
        real, imaginary = basis.columns[:count] @ shape, basis.columns[count:] @ shape
        scaled = points / unit[:, None]
        left = [_differences(scaled.real, real), _differences(scaled.imag, imaginary)]
        radius = cp.Variable(count)
        size, limits = cp.sum(cp.multiply(shares, radius**2)), []
        if isinstance(program, StadiumCover):
            direction = _directions(program, near, response)
            along, half = cp.Variable(points.shape), cp.Variable(count)
            parts = (direction.real, direction.imag)
            left = [each - cp.multiply(part[:, None], along)
                    for each, part in zip(left, parts, strict=True)]  # fmt: skip
            limits.append(cp.abs(along) <= _equal_columns(half, points.shape[1]))
            size += HALF_LENGTH_WEIGHT * cp.sum(cp.multiply(shares, half**2))
        flat = cp.vstack([cp.vec(each, order="C") for each in left])
        limits.append(
            cp.norm(flat, axis=0) <= cp.vec(_equal_columns(radius, points.shape[1]), order="C")
        )
        problem = cp.Problem(cp.Minimize(size), limits)
    _, said = solve_conic(problem, solver, context.options, context)
    if shape.value is None:
        raise SolverError(f"the cone program has no answer: {said}")
    return with_numerator(basis, shape.value, near.poles, scale), said


def _directions(program: StadiumCover, near: Rational, response: ComplexArray) -> ComplexArray:
    """Unit directions (F,) of the sets in the plane of the plants."""
    third = program.third_set(program.deviations_from(near, program.points))
    turn = np.exp(1j * third.angle)
    relative = program.form == "multiplicative"
    return np.asarray(turn * response / np.abs(response) if relative else turn)


def _differences(points: RealArray, value: Any) -> Any:
    """Points (F, N) less a value (F,) for each row."""
    return points - _equal_columns(value, points.shape[1])


def _equal_columns(value: Any, count: int) -> Any:
    """A vector (F,) as a matrix (F, count) of equal columns."""
    import cvxpy as cp

    return cp.reshape(value, (value.size, 1), order="C") @ np.ones((1, count))
