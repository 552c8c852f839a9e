"""Conic programs given by their data, and proofs that they have no solution or no least value.

Takes: c, A, b and cones, from a Program, from CVXPY or from a file.
Gives: answers of any conic solver, with dual bounds and exact rays.
Rests on: weak duality and the theorem of alternatives.
"""

from typing import TYPE_CHECKING

from workbench._core.on_demand import no_more_names
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm
from workbench.conic.claims import ConicallyStated, NoLeastValue, NoSolution
from workbench.conic.cvxpy_program import CvxpyProgram
from workbench.conic.named_solvers import conic_solver
from workbench.conic.program import ConicProgram

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

__all__ = [
    "ConeFactor",
    "ConeKind",
    "ConicForm",
    "ConicProgram",
    "ConicallyStated",
    "CvxpyProgram",
    "NoLeastValue",
    "NoSolution",
    "conic_solver",
]
