"""Conditions on a CVXPY problem for a certified answer, and messages that say which one fails."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.reductions.eval_params import EvalParams

from workbench._core.arrays import EPS
from workbench.conic.expressions import CONSTRAINTS, dense
from workbench.errors import InputError

INEXACT = 16 * EPS
"""Largest error of an exponent that CVXPY approximates by a fraction; a larger one changes the
problem.
"""


def need_statement(problem: Any) -> Any:
    """The problem with numbers in place of its parameters; its variables are the user's own.

    Raises
    ------
    InputError
        The problem is not disciplined convex with real numbers; the message says which part is not.
    """
    if not isinstance(problem, cp.Problem):
        raise InputError(f"a cvxpy.Problem is needed, not {type(problem).__name__}")
    without = [one.name() for one in problem.parameters() if one.value is None]
    if without:
        raise InputError(f"parameters without a value: {', '.join(without)}; set their .value")
    whole = [one.name() for one in problem.variables() if one.boolean_idx or one.integer_idx]
    if whole:
        raise InputError(
            f"integer or boolean variables: {', '.join(whole)}; no bound is proven for them: fix "
            "their values, or solve the problem without the attribute, which bounds it"
        )
    _need_numbers(problem)
    stated, _ = EvalParams().apply(problem)
    _need_discipline(stated)
    for number, one in enumerate(stated.constraints, 1):
        if type(one).__name__ not in CONSTRAINTS:
            raise InputError(
                f"constraint {number} is a {type(one).__name__}; checked are "
                f"{', '.join(CONSTRAINTS)}"
            )
    for atom in _atoms(stated):
        if getattr(atom, "quad_approx", ()):
            raise InputError(
                f"CVXPY replaces {type(atom).__name__} by cones that are near it, which is another "
                "problem: no bound of it is one of yours"
            )
        error = getattr(atom, "approx_error", 0.0)
        if error > INEXACT:
            raise InputError(
                f"CVXPY replaces an exponent of {atom} by a fraction that is {error:.2g} from it, "
                "which is another problem: state it with a fraction of small numbers"
            )
    return stated


def _need_numbers(problem: Any) -> None:
    """Raise InputError for a constant or parameter that is not finite."""
    for number, part in enumerate([problem.objective, *problem.constraints]):
        for one in (*part.constants(), *part.parameters()):
            if not np.isfinite(dense(one.value)).all():
                place = f"constraint {number}" if number else "the objective"
                raise InputError(f"{place} has a number that is not finite, in {one.name()}")


def _need_discipline(problem: Any) -> None:
    """Raise InputError if CVXPY's rules do not show that a problem is convex."""
    if problem.is_dcp():
        return
    if problem.is_dgp():
        raise InputError(
            "a geometric program; state it in the logarithms of its variables, as log_sum_exp"
        )
    wrong = [f"constraint {k}" for k, one in enumerate(problem.constraints, 1) if not one.is_dcp()]
    parts = [*([] if problem.objective.is_dcp() else ["the objective"]), *wrong]
    more = " (quasiconvex: bisect its value)" if problem.is_dqcp() else ""
    raise InputError(
        f"by CVXPY's rules (DCP) {' and '.join(parts)} cannot be told to be convex{more}; without "
        "that nothing proves a bound"
    )


def _atoms(problem: Any) -> Iterator[Any]:
    """Every part of a problem's expressions, each listed once."""
    seen: set[int] = set()
    parts = [problem.objective.expr, *problem.constraints]
    while parts:
        one = parts.pop()
        if id(one) not in seen:
            seen.add(id(one))
            parts += getattr(one, "args", [])
            yield one
