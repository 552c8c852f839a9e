"""The conic form of a problem stated in CVXPY, by CVXPY's own reductions."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy import settings
from cvxpy.constraints import PSD, SOC, NonNeg, Zero
from cvxpy.error import SolverError
from cvxpy.reductions.solvers.conic_solvers.conic_solver import ConicSolver
from scipy.sparse import csr_array

from workbench._core.arrays import RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.errors import InputError


class FormSolver(ConicSolver):
    """A dummy solver for CVXPY that solves nothing: it makes CVXPY bring a problem to its form."""

    SUPPORTED_CONSTRAINTS = [Zero, NonNeg, SOC, PSD]  # noqa: RUF012  (as CVXPY's own have it)
    EXP_CONE_ORDER = [0, 1, 2]  # noqa: RUF012

    def name(self) -> str:
        return "WORKBENCH_FORM"

    def import_solver(self) -> None:
        """There is nothing to import."""

    def cite(self, data: Any) -> str:
        return ""

    def solve_via_data(self, *args: Any, **keywords: Any) -> None:
        raise NotImplementedError("only the form is asked for")


@dataclass(frozen=True, eq=False)
class Canonical:
    """A CVXPY problem as a conic form, and the way back for its dual points.

    ``constant`` is the part of the objective that the form leaves out: the problem is to minimise
    c'x + constant, which is minus the objective if the user maximises.
    """

    form: ConicForm
    constant: float
    chain: Any
    inverse: Any
    hermitian: tuple[int, ...]
    """Ids of the constraints that a complex matrix is semidefinite."""

    def dual_values(self, y: RealArray) -> dict[int, Any]:
        """Dual values by the id of the constraints, for a dual point y (m,) of the form.

        CVXPY has X as the real matrix (Re X, -Im X; Im X, Re X), and reads the left half of its
        dual matrix. The right half agrees only if the dual point has the same pattern. Half the sum
        of both has this pattern, and proves the same bound.
        """
        found = self._inverted(y, turned=False)
        if self.hermitian:
            turned = self._inverted(y, turned=True)
            found |= {one: (found[one] + turned[one]) / 2 for one in self.hermitian}
        return found

    def _inverted(self, y: RealArray, *, turned: bool) -> dict[int, Any]:
        full = []
        for cone, rows in self.form.blocks:
            part = y[rows]
            if _is_matrix(cone):
                Y = _square(cone.size, part)
                part = (_turned(Y) if turned and cone.size % 2 == 0 else Y).ravel()
            full.append(part)
        equations = sum(cone.size for cone in self.form.cones if cone.kind is ConeKind.ZERO)
        flat = np.concatenate([*full, np.zeros(0)])
        solution = {
            "status": settings.OPTIMAL,
            "value": 0.0,
            "primal": np.zeros(self.form.c.size),
            "eq_dual": flat[:equations],
            "ineq_dual": flat[equations:],
        }
        return dict(self.chain.invert(solution, self.inverse).dual_vars)


def canonical_form(problem: Any) -> Canonical:
    """The conic form of a disciplined convex problem with real numbers for its parameters.

    Raises
    ------
    InputError
        The problem needs a cone that is not in `ConeKind`, or CVXPY would approximate one.
    """
    if not problem.variables():  # CVXPY has no conic form without a variable
        idle = cp.Variable()
        problem = cp.Problem(type(problem.objective)(problem.objective.expr + 0 * idle),
                             problem.constraints)  # fmt: skip
    try:
        with warnings.catch_warnings():  # about a sparse variable that is read as an array
            warnings.simplefilter("ignore")
            data, chain, inverse = problem.get_problem_data(FormSolver())
    except SolverError as error:
        raise InputError(
            "the problem needs a cone without proofs here, such as an exponential or a power cone; "
            f"those of {', '.join(ConeKind)} have them (CVXPY says: {error})"
        ) from None
    if any(type(step).__name__ == "ApproxCone2Cone" for step in chain.reductions):
        raise InputError(
            "CVXPY approximates a cone of this problem, as that of operator relative entropy, so "
            "that no bound of its form is one of the problem"
        )
    dims = data[FormSolver.DIMS]
    cones = [
        *_cones(ConeKind.ZERO, [dims.zero]),
        *_cones(ConeKind.NONNEGATIVE, [dims.nonneg]),
        *_cones(ConeKind.SECOND_ORDER, dims.soc),
        *_cones(ConeKind.SEMIDEFINITE, dims.psd),
    ]
    rows = _triangles(cones)
    form = ConicForm(data["c"], rows @ csr_array(data["A"]), rows @ data["b"], tuple(cones))
    constant = float(np.sum(inverse[-1][settings.OFFSET]))
    hermitian = [one.id for one in problem.constraints if isinstance(one, PSD) and one.is_complex()]
    return Canonical(form, constant, chain, inverse, tuple(hermitian))


def _cones(kind: ConeKind, sizes: Sequence[int]) -> list[ConeFactor]:
    return [ConeFactor(kind, int(size)) for size in sizes if size]


def _is_matrix(cone: ConeFactor) -> bool:
    return cone.kind is ConeKind.SEMIDEFINITE


def _triangles(cones: Sequence[ConeFactor]) -> csr_array:
    """The map from CVXPY's rows, n^2 for a matrix, to those of the triangle of its symmetric
    part.
    """
    places: list[tuple[int, int, float]] = []
    row = column = 0
    for cone in cones:
        if _is_matrix(cone):
            n = cone.size
            for k, (i, j) in enumerate(triangle(n)):
                places += [(row + k, column + i + n * j, 0.5), (row + k, column + j + n * i, 0.5)]
            column += n * n
        else:
            places += [(row + k, column + k, 1.0) for k in range(cone.rows)]
            column += cone.rows
        row += cone.rows
    at_rows, at_columns, values = zip(*places, strict=True) if places else ((), (), ())
    return csr_array((values, (at_rows, at_columns)), (row, column), dtype=float)


def _square(n: int, y: RealArray) -> RealArray:
    """The dual matrix of a triangle, whose off-diagonal entries count twice."""
    Y = np.zeros((n, n))
    for (i, j), value in zip(triangle(n), y, strict=True):
        Y[i, j] = Y[j, i] = value if i == j else value / 2
    return Y


def _turned(Y: RealArray) -> RealArray:
    """J'YJ with J = (0, -I; I, 0)."""
    n = len(Y) // 2
    return np.block([[Y[n:, n:], -Y[n:, :n]], [-Y[:n, n:], Y[:n, :n]]])
