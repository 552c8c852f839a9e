"""A user's own convex problem, stated in CVXPY, for every conic solver."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench._core.arrays import Array
from workbench._core.heavy_types import Dataset
from workbench.certificate import Check, worst_value
from workbench.certify.cones.form import ConeKind, ConicForm
from workbench.certify.cones.rays import dual_bound, excluded_radius
from workbench.conic.claims import ConicallyStated, parsed_rational
from workbench.conic.expressions import (
    RESERVED,
    current,
    domains,
    lent_values,
    named_variables,
    of_attributes,
    violations,
)
from workbench.conic.ray_search import dual_point, dual_ray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import Claim, conic_method
from workbench.second_opinion import conic_proofs, lagrangians
from workbench.solution import Solution, solve
from workbench.solvers import ConicSolver, Options, Outcome, solve_conic

if TYPE_CHECKING:
    from workbench.conic.canonical import Canonical

LONGEST = 60
"""Largest number of characters of a constraint in a message."""


@dataclass(frozen=True, eq=False)
class CvxpyProgram(ConicallyStated):
    """A disciplined convex problem of CVXPY, as its user states it.

    An answer is a dataset with the values of the problem's variables by name (``variable_1``, ...
    where they have none). Feasibility and value are checked on the user's own expressions. The
    answer's ``canonical_dual`` is a rational dual point of the conic form that CVXPY makes of the
    problem; it proves that no feasible value is better than the metric ``bound``. The absence of a
    solution, or of a best value, is proven on that form too.

    Distances and gaps are relative to 1 + magnitudes, so a problem with numbers near 1e-10 should
    be stated in other units. The conic form is CVXPY's, with its doubles taken as exact.

    Parameters
    ----------
    problem
        A `cvxpy.Problem` with cones of `ConeKind`, without integer variables. Its parameters must
        have values; the current ones are used.

    Raises
    ------
    InputError
        The problem is not disciplined convex, has an integer variable, a parameter without a value,
        a number that is not finite, or needs a cone without proofs.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import workbench as wb
    >>> from workbench.conic import CvxpyProgram
    >>> x = cp.Variable(2, name="x")
    >>> program = CvxpyProgram(cp.Problem(cp.Minimize(cp.norm(x)), [cp.sum(x) == 2]))
    >>> solution = wb.solve(program, method="scs")
    >>> solution.certificate.holds, solution.answer["x"].values.round(5).tolist()
    (True, [1.0, 1.0])
    """

    problem: Any
    stated: Any = field(init=False, repr=False)
    """The problem with numbers in place of its parameters."""
    canonical: Canonical = field(init=False, repr=False)
    numbers: tuple[Any, ...] = field(init=False, repr=False)
    """Every constant and parameter, so that a later change of one is noticed."""

    default_method = "clarabel"
    headline = "value"
    checks_follow_accuracy = True

    @property
    def quantifier(self) -> str:
        return "for this one problem"

    def __post_init__(self) -> None:
        from workbench.conic.canonical import canonical_form
        from workbench.conic.statement import need_statement

        stated = need_statement(self.problem)
        given = (*self.problem.parameters(), *stated.constants())
        numbers = tuple(one.value for one in given)
        vars(self).update(stated=stated, canonical=canonical_form(stated), numbers=numbers)

    def conic_form(self) -> ConicForm:
        return self.canonical.form

    @property
    def problem_size(self) -> float:
        """Number of the form's variables."""
        return float(self.canonical.form.c.size)

    @property
    def variables(self) -> dict[str, Any]:
        """The problem's variables by the names that they have in an answer."""
        return named_variables(self.stated)

    @property
    def sign(self) -> float:
        """Factor from the user's objective to the minimised one: -1 if the objective is to be
        maximised.
        """
        return 1.0 if self.problem.objective.NAME == "minimize" else -1.0

    def at(self, answer: Dataset) -> AbstractContextManager[None]:
        """The answer's values, lent to the user's variables."""
        found = {}
        for name, one in self.variables.items():
            if name not in answer or answer[name].shape != one.shape:
                raise InputError(f"an answer needs {name} of shape {one.shape}")
            found[name] = answer[name].values
        return lent_values(self.stated, found)

    def objective(self, answer: Dataset) -> float:
        with self.at(answer):
            return self.sign * float(np.real(self.stated.objective.expr.value))

    def objective_scale(self, answer: Dataset) -> float:
        return 1.0 + abs(self.objective(answer))

    def answer_now(self) -> Dataset | None:
        """The current values of the variables; None if one has no value."""
        import xarray as xr

        found: dict[str, Any] = {}
        for name, one in self.variables.items():
            value = current(one)
            if value is None:
                return None
            found[name] = (_dims(name, value), value, {"units": "1"})
        return xr.Dataset(found)

    def witnessed(self, answer: Dataset) -> Dataset:
        y = dual_point(self.canonical.form)
        if y is None:
            return answer
        return answer.assign({RESERVED: ("row", [str(value) for value in y], {"units": "1"})})

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        constraints, domain = self.stated.constraints, domains(self.stated)
        with self.at(answer):
            off = [_largest(violations(one)) for one in constraints]
            beyond = [_largest(violations(one)) for one in domain]
        own = self.variables
        apart = [_largest(of_attributes(one, answer[name].values)) for name, one in own.items()]
        places = [f"{number}, {_cut(one)}" for number, one in enumerate(constraints, 1)]
        told = (
            ("constraints", "a constraint", off, places),
            ("domain", "where an atom is defined", beyond, [*map(_cut, domain)]),
            ("variables", "what a variable is declared to be", apart, [*own]),
        )
        found = []
        for name, what, values, labels in told:
            found.append(_distance(name, what, values, labels, tolerance))
        infinite = float(not math.isfinite(self.objective(answer)))
        return [*found, Check("objective", "1 if it has no finite value", infinite, 0.0)]

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        bound, y = self.bound(answer), dual_of(answer)
        if bound is None or y is None:
            return []
        form, duals, domain = self.canonical.form, self.dual_values(y), domains(self.stated)
        with self.at(answer):
            drawn = lagrangians.lagrangian_above(
                self.stated, duals, float(bound), self.sign, domain
            )
        return [conic_proofs.supports(form, y), conic_proofs.dual_equations(form, y), drawn]

    def dual_values(self, y: Sequence[Any]) -> dict[int, Any]:
        """Values of the constraints' dual variables by the constraint's id, with CVXPY's signs."""
        near = np.array([float(Fraction(str(value))) for value in y])
        return dict(self.canonical.dual_values(near))

    def bound(self, answer: Dataset) -> Fraction | None:
        """Proven lower bound of the minimised objective over all feasible points; None without a
        proof.
        """
        y = dual_of(answer)
        found = None if y is None else dual_bound(self.canonical.form, y)
        return None if found is None else found + Fraction(self.canonical.constant)

    def gap(self, answer: Dataset) -> tuple[str, float]:
        statement = "value beyond the exact bound of the dual point, relative to 1 + |value|"
        if RESERVED not in answer:
            return f"{statement}; no dual point was found", math.inf
        bound = self.bound(answer)
        if bound is None:
            return f"{statement}; the dual point is none", math.inf
        return statement, (self.objective(answer) - float(bound)) / self.objective_scale(answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        bound = self.bound(answer)
        least = -math.inf if bound is None else float(bound)
        return {"value": self.sign * self.objective(answer), "bound": self.sign * least}


def solve_problem(
    problem: Any, method: str | None, options: Options | None, context: Context | None
) -> Solution:
    """The response of `solve` to a CVXPY problem, which then holds the certified results.

    For a valid answer the problem gets its variables, dual variables, value and status: "optimal"
    if the certificate holds, else "optimal_inaccurate". The status may also be a proven
    "infeasible" or "unbounded". In all other cases variables, value and status are None.
    """
    from cvxpy.reductions.solution import Solution as Told

    program = CvxpyProgram(problem)
    solution = solve(program, method=method, options=options, context=context)
    problem._clear_solution()  # CVXPY has no public name for it
    outcome, answer = solution.outcome, solution.answer
    if solution.proof is not None:
        if solution.holds:
            value = program.sign * (math.inf if outcome is Outcome.INFEASIBLE else -math.inf)
            problem.unpack(Told(str(outcome), value, {}, {}, {}))
    elif solution.certificate is not None and solution.certificate.valid:
        primal = {one.id: answer[name].values for name, one in program.variables.items()}
        y = dual_of(answer)
        duals = {} if y is None else program.dual_values(y)
        status = "optimal" if solution.holds else "optimal_inaccurate"
        with warnings.catch_warnings():  # about a sparse variable that is read as an array
            warnings.simplefilter("ignore")
            problem.unpack(Told(status, solution.value, primal, duals, {}))
    return solution


def dual_of(answer: Dataset) -> list[Any] | None:
    """The dual point of an answer; None if it has none."""
    if RESERVED not in answer:
        return None
    return [parsed_rational(str(text)) for text in answer[RESERVED].values]


def _distance(
    name: str, what: str, values: Sequence[float], labels: Sequence[str], tolerance: float
) -> Check:
    value, where = worst_value(values, lambda place: f"of {labels[place[0]]}")
    statement = f"distance from {what}, relative to 1 + the magnitudes of its terms"
    return Check(name, statement, value, tolerance, where=where)


def _largest(values: Array) -> float:
    """The largest distance, 0 if there is none; NaN if one is NaN."""
    return float(values.max(initial=0.0))


def _dims(name: str, value: Array) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}" for axis in range(np.ndim(value)))


def _cut(constraint: Any) -> str:
    text = " ".join(str(constraint).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def _widest(program: CvxpyProgram) -> str:
    """The widest class of cones that a solver needs, in the words of `workbench.solvers.CONES`."""
    if program.stated.is_qp():  # quadratic objectives too, which only this form turns into cones
        return "linear"
    kinds = {cone.kind for cone in program.canonical.form.cones}
    return "semidefinite" if ConeKind.SEMIDEFINITE in kinds else "second-order"


@conic_method(CvxpyProgram, cones=_widest)
def _conic(program: CvxpyProgram, context: Context, solver: ConicSolver) -> Claim:
    """The problem as it is stated."""
    with lent_values(program.stated, {}):
        outcome, said = solve_conic(program.stated, solver, context.options, context)
        answer = None if outcome.without_answer else program.answer_now()
    if outcome is Outcome.FAILED:
        said = f"{said}; {_proven_of_solutions(program.conic_form(), context)}"
    return answer, outcome, said


def _proven_of_solutions(form: ConicForm, context: Context) -> str:
    """What is proven about solutions if a solver ends without a verdict, as it may for weakly
    infeasible problems.
    """
    y = dual_ray(form, context)
    radius = 0.0 if y is None else excluded_radius(form, y)
    said = "there is no certificate, neither of an answer nor of there being none"
    return f"{said}; proven is that no solution has max |x| < R = {radius:.6g}" if radius else said
