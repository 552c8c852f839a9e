"""The Lagrangian of a user's problem at random points: none of its values may be below a bound."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench._core.arrays import Array
from workbench.certificate import Check
from workbench.executor.effort import tries
from workbench.second_opinion import SEED

POINTS = 40
"""Number of random points."""
SPREADS = (0.0, 1e-3, 0.1, 1.0, 10.0)
"""Standard deviations of the points from the answer, relative to 1 + its size, used in turn."""
CONES = ("PSD", "SOC", "ExpCone")
"""Classes of constraints that say that their arguments lie in a cone."""
LAGRANGIAN_ROUNDING = 1e-9
"""Amount by which a Lagrangian in doubles may be below a bound, as a share of its terms."""


def lagrangian_above(
    problem: Any, duals: Mapping[int, Any], bound: float, sign: float, domain: Sequence[Any]
) -> Check:
    """Check that f + sum of dual values times constraints is at least a bound.

    If dual values prove that no feasible f is below the bound, the Lagrangian is not below it at
    any point, feasible or not. The points are drawn around the values of the problem's variables.
    The values of the variables and of the dual variables are changed.

    Parameters
    ----------
    problem
        A CVXPY problem whose variables have values.
    duals
        Dual values by the id of their constraint, with CVXPY's signs.
    bound
        Bound of sign * objective.
    sign
        1, or -1 where the objective is to be maximised.
    domain
        CVXPY constraints; points outside them are not tried.
    """
    rng, worst, within = np.random.default_rng(SEED), -math.inf, 0
    priced = [one for one in problem.constraints if one.id in duals]
    for one in priced:
        one.save_dual_value(duals[one.id])
    centre = {one: np.array(one.value) for one in problem.variables()}
    for number in range(tries(POINTS)):
        for one, value in centre.items():
            one.save_value(_drawn(one, value, SPREADS[number % len(SPREADS)], rng))
        if any(np.max(one.violation(), initial=0.0) > 0.0 for one in domain):
            continue
        terms = [sign * float(np.real(problem.objective.expr.value))]
        terms += [_product(one) for one in priced]
        total, size = sum(terms), 1.0 + abs(bound) + sum(map(abs, terms))
        if math.isnan(total):
            continue
        within += 1
        worst = max(worst, (bound - total) / size if math.isfinite(size) else -1.0)
    statement = "most that the Lagrangian is below the bound, relative to its terms"
    over = f"at {within} points"
    return Check(
        "Lagrangian", statement, worst if within else math.nan, LAGRANGIAN_ROUNDING, over=over
    )


def _drawn(variable: Any, value: Array, spread: float, rng: np.random.Generator) -> Array:
    """A random value near the given one, with the attributes of the variable; with several
    attributes, the given value.
    """
    if spread == 0.0 or variable.num_attributes > 1:
        return value
    moved = value + spread * (1.0 + np.abs(value)) * rng.standard_normal(value.shape)
    if np.iscomplexobj(value):
        moved = moved + 1j * spread * (1.0 + np.abs(value)) * rng.standard_normal(value.shape)
    if variable.sparse_idx is not None:
        return np.where(value != 0, moved, 0.0)
    found = variable.project(moved)
    return np.asarray(found.toarray() if hasattr(found, "toarray") else found)


def _product(constraint: Any) -> float:
    """The constraint's term in the Lagrangian: at most 0 where the constraint holds."""
    kind, duals = type(constraint).__name__, constraint.dual_variables
    if kind in CONES:
        parts = zip(constraint.args, duals, strict=True)
        return -sum(_inner(part.value, dual.value) for part, dual in parts)
    sign = -1.0 if kind == "NonNeg" else 1.0
    return sign * _inner(constraint.expr.value, duals[0].value)


def _inner(a: Any, b: Any) -> float:
    """Real part of an inner product, in which an infinite entry counts only where b is not 0."""
    a, b = (np.ravel(one.toarray() if hasattr(one, "toarray") else one) for one in (a, b))
    return float(np.sum(np.where(b == 0, 0.0, np.real(a * np.conj(b)))))
