"""Conic programs by their data, and claims that they have no solution or no least value."""

from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm
from workbench.conic.claims import ConicallyStated, NoLeastValue, NoSolution
from workbench.conic.named_solvers import conic_solver
from workbench.conic.program import ConicProgram

__all__ = [
    "ConeFactor",
    "ConeKind",
    "ConicForm",
    "ConicProgram",
    "ConicallyStated",
    "NoLeastValue",
    "NoSolution",
    "conic_solver",
]
