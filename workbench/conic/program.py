"""Conic programs given by their data, for every conic solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import EPS, RealArray
from workbench._core.heavy_types import Dataset
from workbench.certificate import Check, worst_value
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.certify.cones.rays import dual_bound
from workbench.conic.claims import ConicallyStated, parsed_rational
from workbench.conic.ray_search import dual_point
from workbench.errors import InputError
from workbench.executor import Context
from workbench.input_checks import need_kind, need_numbers
from workbench.program import Claim, conic_method
from workbench.second_opinion import conic_proofs
from workbench.solvers import ConicSolver, solve_conic


@dataclass(frozen=True, eq=False)
class ConicProgram(ConicallyStated):
    """The least c'x with b - A x in a product of cones.

    An answer is a dataset with ``x``; its ``dual`` is a rational y of the dual cone with
    A'y = -c, which proves that no solution has a value below -b'y.

    Parameters
    ----------
    form
        c, A, b and the cones.
    constant, maximise
        The metric ``value`` is c'x + constant; with ``maximise`` it is -c'x + constant, since a
        program to be maximised is minimised with its sign changed.

    Examples
    --------
    >>> import workbench as wb
    >>> from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram
    >>> cones = (ConeFactor(ConeKind.NONNEGATIVE, 2),)
    >>> program = ConicProgram(ConicForm([1.0], [[-1.0], [1.0]], [-2.0, 5.0], cones))
    >>> solution = wb.solve(program, method="clarabel")
    >>> solution.certificate.holds, round(float(solution.answer["x"][0]), 5)  # the least x >= 2
    (True, 2.0)
    """

    form: ConicForm
    _: KW_ONLY
    constant: float = 0.0
    maximise: bool = False

    default_method = "clarabel"
    headline = "value"
    checks_follow_accuracy = True

    @property
    def quantifier(self) -> str:
        return "for this one program"

    def __post_init__(self) -> None:
        need_kind(self.form, ConicForm, "form")
        need_numbers(constant=self.constant)
        if not math.isfinite(self.constant):
            raise InputError(f"constant is {self.constant!r}; it must be finite")
        need_kind(self.maximise, bool, "maximise")

    def conic_form(self) -> ConicForm:
        return self.form

    @property
    def problem_size(self) -> float:
        """Number of variables."""
        return float(self.form.c.size)

    def objective(self, answer: Dataset) -> float:
        return float(self.form.c @ answer["x"].values)

    def objective_scale(self, answer: Dataset) -> float:
        return 1.0 + abs(self.objective(answer))

    def objective_rounding(self, answer: Dataset) -> float:
        return EPS * float(np.abs(self.form.c) @ np.abs(answer["x"].values))

    def witnessed(self, answer: Dataset) -> Dataset:
        y = dual_point(self.form)
        if y is None:
            return answer
        return answer.assign(dual=("row", [str(value) for value in y], {"units": "1"}))

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        form, x = self.form, answer["x"].values
        s = form.b - form.A @ x
        # A row of large size must not hide the violation of another one.
        size = 1.0 + np.abs(form.b) + abs(form.A) @ np.abs(x)
        off = [relative_violation(cone, s[rows], size[rows]) for cone, rows in form.blocks]
        value, where = worst_value(off, lambda place: f"of cone {place[0]}")
        statement = "distance of b - A x from its cone, relative to 1 + |b| + |A| |x| of its rows"
        return [Check("solution", statement, value, tolerance, where=where)]

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        form, x = self.form, answer["x"].values
        if "dual" not in answer:
            return [conic_proofs.inside(form, x, self.checks(answer, math.inf)[0].value)]
        y = [str(value) for value in answer["dual"].values]
        gap = self.gap(answer)[1] * self.objective_scale(answer)
        return [conic_proofs.supports(form, y), *conic_proofs.duality(form, x, y, gap)]

    def gap(self, answer: Dataset) -> tuple[str, float]:
        form, value = self.form, self.objective(answer)
        statement = "value above the exact bound of the dual point, relative to 1 + |value|"
        if "dual" not in answer:
            return f"{statement}; no dual point was found", math.inf
        y = [parsed_rational(str(text)) for text in answer["dual"].values]
        bound = dual_bound(form, y)
        if bound is None:
            return f"{statement}; the dual point is none", math.inf
        return statement, (value - float(bound)) / self.objective_scale(answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        sign = -1.0 if self.maximise else 1.0
        return {"value": sign * self.objective(answer) + self.constant}


def relative_violation(cone: ConeFactor, s: RealArray, size: RealArray) -> float:
    """Largest amount by which doubles s leave a cone, relative to the size of their row or rows."""
    if cone.kind in (ConeKind.ZERO, ConeKind.NONNEGATIVE):
        return violation(cone, s / size)
    return violation(cone, s) / float(size.max())


def violation(cone: ConeFactor, s: RealArray) -> float:
    """Largest amount by which doubles s leave a cone; 0 or less inside."""
    if cone.kind is ConeKind.ZERO:
        return float(np.abs(s).max())
    if cone.kind is ConeKind.NONNEGATIVE:
        return float(-s.min())
    if cone.kind is ConeKind.SECOND_ORDER:
        return float(np.linalg.norm(s[1:]) - s[0])
    S = np.zeros((cone.size, cone.size))
    for (i, j), value in zip(triangle(cone.size), s, strict=True):
        S[i, j] = S[j, i] = value
    return float(-np.linalg.eigvalsh(S)[0]) if np.isfinite(S).all() else math.inf


def _widest(program: ConicProgram) -> str:
    """The widest class of its cones, in the words of `workbench.solvers.CONES`."""
    kinds = {cone.kind for cone in program.form.cones}
    if ConeKind.SEMIDEFINITE in kinds:
        return "semidefinite"
    return "second-order" if ConeKind.SECOND_ORDER in kinds else "linear"


@conic_method(ConicProgram, cones=_widest)
def _conic(program: ConicProgram, context: Context, solver: ConicSolver) -> Claim:
    """The program as it is given."""
    import cvxpy as cp
    import xarray as xr

    form = program.form
    with context.stating():
        x = cp.Variable(form.c.size)
        slack = form.b - form.A @ x
        held = [_inside(cone, slack[rows]) for cone, rows in form.blocks]
        problem = cp.Problem(cp.Minimize(form.c @ x), held)
    outcome, said = solve_conic(problem, solver, context.options, context)
    if x.value is None:
        return None, outcome, said
    return xr.Dataset({"x": ("column", x.value, {"units": "1"})}), outcome, said


def _inside(cone: ConeFactor, s: Any) -> Any:
    """The CVXPY constraint that an expression lies in a cone."""
    import cvxpy as cp

    if cone.kind is ConeKind.ZERO:
        return s == 0
    if cone.kind is ConeKind.NONNEGATIVE:
        return s >= 0
    if cone.kind is ConeKind.SECOND_ORDER:
        return cp.SOC(s[0], s[1:]) if cone.size > 1 else s >= 0
    n = cone.size
    full = np.zeros((n * n, cone.rows))
    for row, (i, j) in enumerate(triangle(n)):
        full[i * n + j, row] = full[j * n + i, row] = 1.0
    return cp.reshape(full @ s, (n, n), order="C") >> 0
