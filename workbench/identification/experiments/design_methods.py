"""Methods for spectra: a semidefinite program for every conic solver, and a nonlinear program."""

from __future__ import annotations

import numpy as np

from workbench.accuracy import AccuracyRange
from workbench.executor import Context
from workbench.identification.experiments.design import ExperimentDesign
from workbench.program import Claim, conic_method, method
from workbench.solvers import ConicSolver, in_one_thread, ipopt, ipopt_outcome, solve_conic

FINEST_ACCURACY = 1e-8
"""Finest tolerance that the solvers are given."""
DESIGN_ACCURACY = AccuracyRange(finest=FINEST_ACCURACY)
START_SHARE = 1e-6
"""Least power of a line for IPOPT, relative to equal powers; it keeps the information regular."""


@conic_method(ExperimentDesign, optimal=False, accuracy=DESIGN_ACCURACY)
def _conic(program: ExperimentDesign, context: Context, solver: ConicSolver) -> Claim:
    """The semidefinite program [M root(c) Psi; . t I] >= 0 for every watched frequency."""
    import cvxpy as cp

    unit = float(program.costs(program.even).max())
    with context.stating():
        share, level = cp.Variable(len(program.slopes), nonneg=True), cp.Variable()
        count = program.information.shape[1]
        flat = (program.information * program.even[:, None, None]).reshape(len(program.even), -1)
        M = cp.reshape(flat.T @ share, (count, count), order="C")
        held = [program.uses @ cp.multiply(program.even, share) <= 1.0]
        held += [
            cp.bmat([[(M + M.T) / 2, plane], [plane.T, level * np.eye(2)]]) >> 0
            for plane in program.planes / np.sqrt(unit)
        ]
        problem = cp.Problem(cp.Minimize(level), held)
    outcome, said = solve_conic(problem, solver, context.options, context)
    if share.value is None:
        return None, outcome, said
    return program.spectrum(program.even * share.value), outcome, said


@method(ExperimentDesign, "ipopt", optimal=False, accuracy=DESIGN_ACCURACY)
@in_one_thread
def _ipopt(program: ExperimentDesign, context: Context) -> Claim:
    """IPOPT on the powers; the eigenvalues of each plane come from trace and determinant."""
    import casadi

    lines, unit = len(program.slopes), float(program.costs(program.even).max())
    with context.stating():
        share, level = casadi.SX.sym("share", lines), casadi.SX.sym("level")
        count = program.information.shape[1]
        M = casadi.SX.zeros(count, count)
        for k, part in enumerate(program.information * program.even[:, None, None]):
            M += share[k] * part
        inverse = casadi.solve(M, casadi.SX.eye(count))
        held = [1.0 - program.uses @ (program.even * share)]
        for plane in program.planes / np.sqrt(unit):
            first, second = plane.T
            along = level - casadi.bilin(inverse, first, first)
            beside = level - casadi.bilin(inverse, second, second)
            cross = casadi.bilin(inverse, first, second)
            held += [along, along * beside - cross**2]
        statement = {
            "x": casadi.vertcat(share, level), "f": level, "g": casadi.vertcat(*held),
        }  # fmt: skip
        solver = ipopt("design", statement, context.options)
    start = np.append(np.full(lines, 0.9), 2.0)
    low = np.append(np.full(lines, START_SHARE), 0.0)
    found = solver(x0=start, lbx=low, lbg=0.0, ubg=np.inf)
    outcome, said = ipopt_outcome(solver)
    return program.spectrum(program.even * np.asarray(found["x"]).ravel()[:-1]), outcome, said
