"""A user's own CVXPY expressions, evaluated at values that are lent to their variables."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray

CONSTRAINTS = ("Equality", "Zero", "Inequality", "NonPos", "NonNeg", "SOC", "PSD")
"""Classes of CVXPY's constraints that are checked."""
RESERVED = "canonical_dual"
"""The name of the dual point among an answer's variables."""


def named_variables(problem: Any) -> dict[str, Any]:
    """The variables of a problem by name.

    A variable without a name of its own, or with the name of another one, gets a name with its
    number.
    """
    found = problem.variables()
    own = [None if one.name() == f"var{one.id}" else one.name() for one in found]
    counted = Counter([*own, RESERVED])
    return {
        name if name and counted[name] == 1 else f"{name or 'variable'}_{number}": one
        for number, (name, one) in enumerate(zip(own, found, strict=True), 1)
    }


@contextmanager
def lent_values(problem: Any, values: Mapping[str, Array]) -> Iterator[None]:
    """Values by name for a problem's variables, None for the others.

    On leaving the context each variable and dual variable has its own value again. Inside, CVXPY's
    warnings are silenced, such as the one about a sparse variable that is read as an array.
    """
    primal = named_variables(problem)
    all_of_them = [*primal.values()]
    all_of_them += [two for one in problem.constraints for two in one.dual_variables]
    own = [(one, current(one)) for one in all_of_them]
    try:
        for name, one in primal.items():
            one.save_value(values.get(name))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for one, value in own:
            one.save_value(value)


def current(variable: Any) -> Any:
    """The value of a variable as a new array; None if it has no value."""
    with warnings.catch_warnings():  # CVXPY warns about a sparse variable that is read as an array
        warnings.simplefilter("ignore")
        return dense(variable.value)


def domains(problem: Any) -> list[Any]:
    """Constraints that keep the arguments of atoms where these are defined, such as x >= 0 for log
    x.

    CVXPY evaluates some atoms, such as a cube, elsewhere too.
    """
    parts = [problem.objective.expr, *(two for one in problem.constraints for two in one.args)]
    return [one for part in parts for one in part.domain]


def dense(value: Any) -> Any:
    """A new array for a value that may be sparse; None stays None."""
    if value is None:
        return None
    return np.array(value.toarray() if hasattr(value, "toarray") else value)


def magnitudes(expression: Any) -> RealArray:
    """Sum of the sizes of an expression's terms, entry by entry: its value if none cancelled
    another.

    Cancellation within an atom that is not affine is not counted: its magnitude is that of its
    value.
    """
    from cvxpy.atoms.affine.affine_atom import AffAtom

    if not isinstance(expression, AffAtom):
        return np.abs(dense(expression.value))
    parts = [magnitudes(one) for one in expression.args]
    if type(expression).__name__ in ("NegExpression", "real", "imag", "conj"):
        return parts[0]
    return np.abs(dense(expression.numeric(parts)))


def violations(constraint: Any) -> RealArray:
    """Distances by which a constraint is violated, relative to 1 + the magnitudes of its terms.

    Entry by entry; or cone by cone, with the largest magnitude in the cone.
    """
    kind = type(constraint).__name__
    if kind == "SOC":
        return _second_order(constraint)
    expression = constraint.args[0] if kind == "PSD" else constraint.expr
    value, size = dense(expression.value), 1.0 + magnitudes(expression)
    if kind == "PSD":
        return _semidefinite(value, size)
    off = {"Inequality": value, "NonPos": value, "NonNeg": -value}.get(kind, np.abs(value))
    return np.asarray(off / size)


def _second_order(constraint: Any) -> RealArray:
    t, X = (dense(one.value) for one in constraint.args)
    t_size, X_size = (magnitudes(one) for one in constraint.args)
    if np.ndim(X) > 0:
        axis = constraint.axis if np.ndim(X) > 1 else 0
        X, X_size = np.linalg.norm(X, axis=axis), X_size.max(axis=axis, initial=0.0)
    return np.ravel((np.abs(X) - t) / (1.0 + np.maximum(t_size, X_size)))


def _semidefinite(S: Array, size: RealArray) -> RealArray:
    """Violations for the Hermitian parts of matrices (..., n, n)."""
    if not np.isfinite(S).all():
        return np.array([np.inf])
    least = np.linalg.eigvalsh((S + np.conj(np.swapaxes(S, -2, -1))) / 2)[..., 0]
    return np.atleast_1d(-least / size.max(axis=(-2, -1)))


def of_attributes(variable: Any, value: Array) -> RealArray:
    """Distances of a variable's value from its attributes, relative to 1 + its magnitudes."""
    asked, size = variable.attributes, 1.0 + np.abs(value)
    off = [np.zeros(1)]
    if asked["nonneg"] or asked["pos"]:
        off.append(-value / size)
    if asked["nonpos"] or asked["neg"]:
        off.append(value / size)
    if asked["bounds"] is not None:
        low, high = (dense(getattr(one, "value", one)) for one in asked["bounds"])
        off += [(low - value) / size, (value - high) / size]
    if not variable.is_complex():
        off.append(np.abs(np.imag(value)) / size)
    if asked["imag"]:
        off.append(np.abs(np.real(value)) / size)
    if any(asked[name] for name in ("symmetric", "PSD", "NSD", "diag")):
        off.append(np.abs(value - np.swapaxes(value, -2, -1)) / size)
    if asked["hermitian"]:
        off.append(np.abs(value - np.conj(np.swapaxes(value, -2, -1))) / size)
    if asked["PSD"]:
        off.append(_semidefinite(value, size))
    if asked["NSD"]:
        off.append(_semidefinite(-value, size))
    if asked["diag"]:
        off.append(np.abs(value - np.diag(np.diag(value))) / size)
    if variable.sparse_idx is not None:
        outside = np.ones(value.shape, dtype=bool)
        outside[variable.sparse_idx] = False
        off.append(np.abs(value[outside]) / size[outside])
    return np.concatenate([np.real(np.ravel(one)) for one in off])
