"""Solvers by name, with one vocabulary of outcomes and options for all of them.

A conic solver is described by data: its name in CVXPY, and how it is told the accuracy asked for.
No solver is imported before it is used.
"""

from __future__ import annotations

import importlib.util
import operator
import warnings
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from functools import cache, wraps
from threading import RLock
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar

from workbench._core.on_demand import no_more_names
from workbench.errors import InputError, SolverError

if not TYPE_CHECKING:
    __getattr__ = no_more_names(__name__)

ACCURACY: Mapping[str, float] = {"low": 1e-3, "middle": 1e-6, "high": 1e-9}
"""Accuracy levels: the largest relative optimality gap allowed for a method that claims
optimality.
"""


class Outcome(StrEnum):
    """Outcome of a solve or a run, in the same words for every solver.

    Examples
    --------
    >>> from workbench import Outcome
    >>> Outcome.SOLVED == "solved", Outcome("infeasible").name
    (True, 'INFEASIBLE')
    """

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    NONE_UP_TO_R = "no solution up to R"
    NO_CLAIM = "no claim"
    TIME_LIMIT = "time limit"
    MEMORY_LIMIT = "memory limit"
    CRASHED = "crashed"
    FAILED = "failed"

    @property
    def proven(self) -> bool:
        """Whether the question is answered and the answer has a certificate that holds."""
        return self in (Outcome.SOLVED, Outcome.INFEASIBLE, Outcome.UNBOUNDED)

    @property
    def without_answer(self) -> bool:
        """Whether it claims that a program has no answer: that it is infeasible or unbounded."""
        return self in (Outcome.INFEASIBLE, Outcome.UNBOUNDED)

    @property
    def advice(self) -> str:
        """One sentence that tells the user what to do."""
        return _ADVICE[self]


_ADVICE = {
    Outcome.SOLVED: "The answer meets every check at the accuracy asked for.",
    Outcome.INACCURATE: "The answer is valid but not as good as claimed: "
    "ask for a lower accuracy or try another method.",
    Outcome.INFEASIBLE: "No answer exists: relax a constraint or check the data.",
    Outcome.UNBOUNDED: "The objective has no limit: a constraint or a bound is missing.",
    Outcome.NONE_UP_TO_R: "No solution is smaller than the stated R; whether there is a larger one "
    "is not known: rescale the program, or relax a constraint.",
    Outcome.NO_CLAIM: "The method says that there is no answer, which nothing proves: "
    "try another method.",
    Outcome.TIME_LIMIT: "Stopped by the clock: raise the time limit or try a faster method.",
    Outcome.MEMORY_LIMIT: "Killed for its memory: raise the limit or try another method.",
    Outcome.CRASHED: "Its process died, twice: read the message, try another method.",
    Outcome.FAILED: "There is no valid answer: read the message, try another method.",
}


@dataclass(frozen=True)
class Options:
    """Options that every method understands.

    Parameters
    ----------
    tolerance
        Relative accuracy, or the name of a level: "low" (1e-3), "middle" (1e-6), "high" (1e-9).
    time_limit
        Seconds; None for no limit.
    verbose
        Let the solver print.
    seed
        Seed of the one random generator.

    Examples
    --------
    >>> from workbench import Options
    >>> Options(tolerance="low").accuracy, Options(tolerance="high", time_limit=10).accuracy
    (0.001, 1e-09)
    """

    _: KW_ONLY
    tolerance: float | str = "middle"
    time_limit: float | None = None
    verbose: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        tolerance = ACCURACY.get(str(self.tolerance), self.tolerance)
        try:
            tolerance = float(tolerance)
        except (TypeError, ValueError):
            raise InputError(
                f"tolerance {tolerance!r} is neither a number nor one of {', '.join(ACCURACY)}"
            ) from None
        if not 0 < tolerance < 1:
            raise InputError(f"tolerance must lie between 0 and 1, not {tolerance}")
        object.__setattr__(self, "tolerance", tolerance)
        if self.time_limit is not None:
            try:
                limit = float(self.time_limit)
            except (TypeError, ValueError):
                limit = -1.0
            if not limit > 0:
                raise InputError(f"time_limit must be positive [s], not {self.time_limit!r}")
            object.__setattr__(self, "time_limit", limit)
        try:
            object.__setattr__(self, "seed", operator.index(self.seed))
        except TypeError:
            raise InputError(f"seed must be a whole number, not {self.seed!r}") from None
        if self.seed < 0:
            raise InputError(f"seed must not be negative, it is {self.seed}")

    @property
    def accuracy(self) -> float:
        """The tolerance as a number."""
        return float(self.tolerance)


class Stopwatch(Protocol):
    """Clock of a solver call: it separates stating a problem from solving it.

    Examples
    --------
    >>> from workbench import Options
    >>> from workbench.executor import Context
    >>> from workbench.solvers import Stopwatch
    >>> clock: Stopwatch = Context(options=Options(tolerance="low"))
    >>> with clock.stating():
    ...     statement = [k**2 for k in range(1000)]
    ...
    >>> clock.statement_seconds > 0
    True
    """

    def stating(self) -> AbstractContextManager[None]:
        """Time spent inside counts as stating the problem, not as solving it."""


@dataclass(frozen=True)
class ConicSolver:
    """A conic solver: its name in CVXPY, and the translation of our options into its own.

    Parameters
    ----------
    name
        Its name as a method.
    module
        Module that must be installed.
    settings
        Function that translates our options into the solver's own.
    finest
        Finest tolerance that the solver is given; finer ones are replaced by it.
    package
        Distribution whose version can change its answers; "": it has the name of the module.
    widest
        The most general of `CONES` that it can handle.
    of_cvxpy
        Its name in CVXPY; "": the same as ``name``. Two solvers may share a CVXPY name and differ
        in their settings.

    Examples
    --------
    >>> from workbench.solvers import ConicSolver
    >>> scs = ConicSolver("scs", "scs", lambda options: {"eps_abs": options.accuracy}, finest=1e-9)
    >>> scs.installed, scs.unfit("second-order")
    (True, '')
    """

    name: str
    module: str
    settings: Callable[[Options], dict[str, Any]]
    _: KW_ONLY
    finest: float = 0.0
    package: str = ""
    widest: str = "semidefinite"
    of_cvxpy: str = ""

    def unfit(self, cones: str) -> str:
        """The reason why it cannot solve a program with these of `CONES`; empty if it can."""
        if CONES.index(cones) <= CONES.index(self.widest):
            return ""
        return f"{self.name} takes {self.widest} cones only, it has {cones} ones"

    @property
    def installed(self) -> bool:
        """Whether the module that it needs can be found."""
        return importlib.util.find_spec(self.module) is not None


# Solvers stop on residuals in their own scaling. The gap that a certificate measures is larger by
# some factor. So each solver is asked for a finer tolerance than wanted, by a factor found by
# experiment.


CVXOPT_FINEST = 3.4e-8
"""Finest tolerance that CVXOPT is given; at finer ones it ends without an answer."""


def _clarabel(options: Options) -> dict[str, Any]:
    tolerance = 0.003 * options.accuracy  # costs one or two more iterations
    settings = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
    return settings | ({"time_limit": options.time_limit} if options.time_limit else {})


def _scs(options: Options) -> dict[str, Any]:
    # a first-order method becomes much slower with more accuracy
    tolerance = 0.1 * options.accuracy
    settings = {"eps_abs": tolerance, "eps_rel": tolerance, "max_iters": 100_000}
    return settings | ({"time_limit_secs": options.time_limit} if options.time_limit else {})


def _cvxopt(options: Options) -> dict[str, Any]:
    tolerance = 0.3 * max(options.accuracy, CVXOPT_FINEST)
    # The default KKT solver fails on LMIs of control; this one is dense but correct.
    return {"abstol": tolerance, "reltol": tolerance, "feastol": tolerance, "kktsolver": "ldl"}


CONES = ("linear", "second-order", "semidefinite")
"""Kinds of cones, from special to general; a solver that handles one handles those before it."""
_CONIC = [
    ConicSolver("clarabel", "clarabel", _clarabel),
    ConicSolver("scs", "scs", _scs),
    ConicSolver("cvxopt", "cvxopt", _cvxopt, finest=CVXOPT_FINEST),
]
_told: list[Callable[[ConicSolver], None]] = []
"""Functions that are called with every conic solver."""


def for_every_conic_solver(told: Callable[[ConicSolver], None]) -> None:
    """Call a function with every installed conic solver, and with each one that is added later.

    Examples
    --------
    >>> from workbench.solvers import for_every_conic_solver
    >>> names = []
    >>> for_every_conic_solver(lambda solver: names.append(solver.name))
    >>> "clarabel" in names
    True
    """
    for solver in conic_solvers():
        told(solver)
    _told.append(told)


def add_conic_solver(solver: ConicSolver) -> None:
    """Make a solver available as a method of every Program that is stated as a conic program.

    Raises
    ------
    InputError
        It is not installed, or another solver has this name.

    Examples
    --------
    >>> from workbench.solvers import ConicSolver, add_conic_solver
    >>> try:
    ...     add_conic_solver(ConicSolver("clarabel", "clarabel", lambda options: {}))
    ... except ValueError as error:
    ...     print(error)
    ...
    a conic solver 'clarabel' is there already
    """
    if not solver.installed:
        package = solver.package or solver.module
        raise InputError(f"{solver.name} is not installed; try: pip install {package}")
    if any(one.name == solver.name for one in _CONIC):
        raise InputError(f"a conic solver {solver.name!r} is there already")
    _CONIC.append(solver)
    for told in _told:
        told(solver)


def conic_solvers() -> tuple[ConicSolver, ...]:
    """The installed conic solvers.

    Examples
    --------
    >>> from workbench.solvers import conic_solvers
    >>> [solver.name for solver in conic_solvers()][:3]
    ['clarabel', 'scs', 'cvxopt']
    """
    return tuple(solver for solver in _CONIC if solver.installed)


def solve_conic(
    problem: Any, solver: ConicSolver, options: Options, stopwatch: Stopwatch
) -> tuple[Outcome, str]:
    """Solve a CVXPY problem in place; return its outcome and the solver's own status.

    Compilation counts as stating the problem. An exception of the solver, or a panic, becomes
    ``Outcome.FAILED`` with its text.

    Examples
    --------
    >>> import cvxpy as cp
    >>> from workbench import Options
    >>> from workbench.executor import Context
    >>> from workbench.solvers import conic_solvers, solve_conic
    >>> x = cp.Variable(2)
    >>> problem = cp.Problem(cp.Minimize(cp.norm(x)), [cp.sum(x) == 2])
    >>> outcome, status = solve_conic(problem, conic_solvers()[0], Options(), Context())
    >>> print(outcome, status, round(float(problem.value), 6))
    solved clarabel: optimal 1.414214
    """
    settings = solver.settings(options)
    try:
        with stopwatch.stating():
            data, chain, inverse = problem.get_problem_data(
                (solver.of_cvxpy or solver.name).upper(), solver_opts=settings
            )
        # The certificate, not the solver's warning, judges the answer.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            raw = chain.solve_via_data(
                problem, data, warm_start=False, verbose=options.verbose, solver_opts=settings
            )
            problem.unpack_results(raw, chain, inverse)
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # A Rust panic is not derived from Exception.
        return Outcome.FAILED, f"{type(error).__name__}: {error}"
    return _CVXPY_STATUS.get(problem.status, Outcome.FAILED), f"{solver.name}: {problem.status}"


_CVXPY_STATUS = {
    "optimal": Outcome.SOLVED,
    "optimal_inaccurate": Outcome.INACCURATE,
    "infeasible": Outcome.INFEASIBLE,
    "infeasible_inaccurate": Outcome.INFEASIBLE,
    "infeasible_or_unbounded": Outcome.INFEASIBLE,
    "unbounded": Outcome.UNBOUNDED,
    "unbounded_inaccurate": Outcome.UNBOUNDED,
    "user_limit": Outcome.TIME_LIMIT,
}


P = ParamSpec("P")
T = TypeVar("T")
_CASADI = RLock()


def in_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """The function for which threads wait, so that only one of them uses CasADi at a time.

    CasADi crashes the process where threads meet, even if each has expressions of its own. Mark
    functions outside of which nothing of CasADi lives on; they may call each other.

    Examples
    --------
    >>> import casadi
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> from workbench.solvers import in_one_thread
    >>> @in_one_thread
    ... def slope(at):
    ...     x = casadi.SX.sym("x")
    ...     return float(casadi.Function("f", [x], [casadi.gradient(x**2, x)])(at))
    ...
    >>> with ThreadPoolExecutor() as threads:
    ...     print(list(threads.map(slope, [1.0, 2.0])))
    [2.0, 4.0]
    """

    @wraps(function)
    def waiting(*arguments: P.args, **keywords: P.kwargs) -> T:
        with _CASADI:
            return function(*arguments, **keywords)

    return waiting


def ipopt(name: str, statement: Mapping[str, Any], options: Options, **more: Any) -> Any:
    """A CasADi function that solves the nonlinear program ``{x, f, g, p}`` with IPOPT.

    ``more`` are further options of IPOPT, under IPOPT's own names. Functions that call this in
    threads need `in_one_thread`.

    Examples
    --------
    >>> import casadi
    >>> from workbench import Options
    >>> from workbench.solvers import ipopt
    >>> x = casadi.SX.sym("x", 2)
    >>> valley = (1 - x[0]) ** 2 + (x[1] - x[0] ** 2) ** 2
    >>> solver = ipopt("valley", {"x": x, "f": valley}, Options())
    >>> [round(float(one), 6) for one in solver(x0=[0, 0])["x"].full().ravel()]
    [1.0, 1.0]
    """
    import casadi

    tolerance = 0.1 * options.accuracy
    settings: dict[str, Any] = {
        "ipopt.tol": tolerance,
        # By default IPOPT widens every bound by 1e-8.
        "ipopt.bound_relax_factor": min(1e-8, tolerance),
        "ipopt.print_level": 5 if options.verbose else 0,
        "ipopt.sb": "yes",
        "print_time": False,
        # A failed solve is an outcome, reported by `ipopt_outcome`, not an exception.
        "error_on_fail": False,
    }
    settings |= {f"ipopt.{name}": value for name, value in more.items()}
    if options.time_limit is not None:
        settings["ipopt.max_wall_time"] = options.time_limit
    return casadi.nlpsol(name, "ipopt", dict(statement), settings)


def ipopt_outcome(solver: Any) -> tuple[Outcome, str]:
    """Outcome and IPOPT's own status of the last call of a function made by `ipopt`.

    Examples
    --------
    >>> import casadi
    >>> from workbench import Options
    >>> from workbench.solvers import ipopt, ipopt_outcome
    >>> x = casadi.SX.sym("x")
    >>> solver = ipopt("parabola", {"x": x, "f": (x - 3) ** 2}, Options())
    >>> answer = solver(x0=0)
    >>> print(*ipopt_outcome(solver))
    solved ipopt: Solve_Succeeded
    """
    status = solver.stats()["return_status"]
    return _IPOPT_STATUS.get(status, Outcome.FAILED), f"ipopt: {status}"


_IPOPT_STATUS = {
    "Solve_Succeeded": Outcome.SOLVED,
    "Solved_To_Acceptable_Level": Outcome.INACCURATE,
    "Feasible_Point_Found": Outcome.INACCURATE,
    "Search_Direction_Becomes_Too_Small": Outcome.INACCURATE,
    "Maximum_Iterations_Exceeded": Outcome.FAILED,
    "Infeasible_Problem_Detected": Outcome.INFEASIBLE,
    "Diverging_Iterates": Outcome.UNBOUNDED,
    "Maximum_CpuTime_Exceeded": Outcome.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Outcome.TIME_LIMIT,
}


PACKAGES = (
    *("casadi", "clarabel", "control", "cvxopt", "cvxpy"),
    *("numba", "numpy", "scipy", "scs", "slycot"),
)


def versions(*, packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Versions of the solvers and numerical libraries that can change an answer.

    Examples
    --------
    >>> from workbench.solvers import versions
    >>> sorted(versions(packages=["numpy", "scipy"]))
    ['numpy', 'scipy']
    """
    return {package: found for package in packages if (found := _version(package)) is not None}


@cache
def _version(package: str) -> str | None:
    """Version of a package; None if it is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return None


SLYCOT_ADVICE = (
    "slycot is not installed: pip install slycot, or conda install -c conda-forge slycot"
)
"""Advice for users without slycot, which some platforms lack."""


@cache
def slycot_missing() -> str | None:
    """The reason why SLICOT cannot be used; None if it can.

    Examples
    --------
    >>> from workbench.solvers import slycot_missing
    >>> slycot_missing() is None
    True
    """
    return None if importlib.util.find_spec("slycot") is not None else SLYCOT_ADVICE


def slicot_routine(name: str) -> Any:
    """A routine of SLICOT, such as "ab13dd".

    Raises
    ------
    SolverError
        slycot is not installed.

    Examples
    --------
    >>> from workbench.solvers import slicot_routine
    >>> slicot_routine("ab13dd").__name__
    'ab13dd'
    """
    if slycot_missing() is not None:
        raise SolverError(f"SLICOT's {name.upper()} is needed here; {SLYCOT_ADVICE}")
    import slycot

    return getattr(slycot, name)
