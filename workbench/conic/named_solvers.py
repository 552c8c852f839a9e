"""Further solvers that CVXPY knows, registered under their names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from workbench.errors import UnknownNameError
from workbench.solvers import ConicSolver, Options, add_conic_solver, conic_solvers

SHARE = 0.1
"""A solver is asked for this share of the wanted accuracy, since it stops by residuals of its
own.
"""


def _tolerances(*names: str, finest: float = 0.0, time: str = "", **more: Any) -> Any:
    """Settings of a solver whose tolerances, and whose time limit [s], have these names."""

    def settings(options: Options) -> dict[str, Any]:
        found = dict.fromkeys(names, max(SHARE * options.accuracy, finest)) | more
        if time and options.time_limit:
            found[time] = options.time_limit
        return found

    return settings


def _mosek(options: Options) -> dict[str, Any]:
    limit = {"MSK_DPAR_OPTIMIZER_MAX_TIME": options.time_limit} if options.time_limit else {}
    return {"eps": SHARE * options.accuracy, "mosek_params": limit}


def _own(options: Options) -> dict[str, Any]:
    """No settings: the solver keeps its own tolerances, whatever accuracy is asked for."""
    return {}


_MODULES = {
    "copt": ("coptpy", "coptpy"),
    "glpk": ("cvxopt", "cvxopt"),
    "gurobi": ("gurobipy", "gurobipy"),
    "highs": ("highspy", "highspy"),
    "proxqp": ("proxsuite", "proxsuite"),
    "scip": ("pyscipopt", "pyscipopt"),
    "sdpa": ("sdpap", "sdpa-python"),
}
"""Module and distribution of solvers whose names there differ from CVXPY's."""
_SETTINGS: dict[str, Callable[[Options], dict[str, Any]]] = {
    "copt": _tolerances("RelGap", "FeasTol", "DualTol", finest=1e-9, time="TimeLimit"),
    "ecos": _tolerances("abstol", "reltol", "feastol", max_iters=500),
    "gurobi": _tolerances("BarConvTol", "BarQCPConvTol", finest=1e-10, time="TimeLimit"),
    "highs": _tolerances(
        *("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
        finest=1e-10,  # HiGHS accepts no smaller tolerance
        time="time_limit",
    ),
    "mosek": _mosek,
    "osqp": _tolerances("eps_abs", "eps_rel", time="time_limit", max_iter=200_000),
    "piqp": _tolerances("eps_abs", "eps_rel", max_iter=1000),
    "proxqp": _tolerances("eps_abs", "eps_rel", max_iter=10_000),
    "qoco": _tolerances("abstol", "reltol", max_iters=500),
    "sdpa": _tolerances("epsilonStar", "epsilonDash", finest=1e-8),
}
"""Settings by which accuracy and time limit are passed to solvers. Solvers that are not listed keep
their own tolerances.
"""


def conic_solver(name: str) -> ConicSolver:
    """Make a solver that CVXPY knows a method for every Program stated as a conic program.

    Programs with cones that it does not support cannot use it. Accuracy and time limit are passed
    to it if its settings are known (see `help` of the module); otherwise it keeps its own.

    Parameters
    ----------
    name
        CVXPY's name for it, such as "mosek" or "highs".

    Returns
    -------
    ConicSolver
        The registered method; a repeated call returns the same one.

    Raises
    ------
    UnknownNameError
        CVXPY has no such solver.
    InputError
        The solver is not installed; the message says what to install.

    Examples
    --------
    >>> from workbench.conic import conic_solver
    >>> conic_solver("SCS").name  # "highs", "mosek" and others are found where they are installed
    'scs'
    """
    from cvxpy.reductions.solvers.defines import SOLVER_MAP_CONIC, SOLVER_MAP_QP

    name = name.lower()
    known = {one.name: one for one in conic_solvers()}
    if name in known:
        return known[name]
    found = SOLVER_MAP_CONIC.get(name.upper()) or SOLVER_MAP_QP.get(name.upper())
    if found is None:
        names = {one.lower() for one in (*SOLVER_MAP_CONIC, *SOLVER_MAP_QP)}
        raise UnknownNameError("solver of CVXPY", name, names)
    cones = {one.__name__ for one in found.SUPPORTED_CONSTRAINTS}
    widest = "semidefinite" if cones & {"PSD", "SvecPSD"} else "linear"
    widest = "second-order" if widest == "linear" and "SOC" in cones else widest
    module, package = _MODULES.get(name, (name, name))
    solver = ConicSolver(name, module, _SETTINGS.get(name, _own), package=package, widest=widest)
    add_conic_solver(solver)
    return solver
