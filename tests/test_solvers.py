"""One vocabulary of outcomes and options, mapped from each solver's own."""

import math
from importlib.metadata import version
from types import SimpleNamespace

import casadi
import cvxpy as cp
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.executor import Context
from workbench.solvers import (
    ACCURACY,
    Options,
    Outcome,
    conic_solvers,
    ipopt,
    ipopt_outcome,
    solve_conic,
    versions,
)

SOLVERS = {solver.name: solver for solver in conic_solvers()}
each_solver = pytest.mark.parametrize("solver", SOLVERS.values(), ids=list(SOLVERS))


def conic(problem, solver, **options):
    return solve_conic(problem, solver, Options(**options), Context())


def least(*constraints, size=2):
    """The least sum of x subject to constraints on x, made by functions of it."""
    x = cp.Variable(size)
    return cp.Problem(cp.Minimize(cp.sum(x)), [make(x) for make in constraints])


# --- outcomes ---------------------------------------------------------------------------------


def test_every_conic_solver_that_is_shipped_is_found():
    assert set(SOLVERS) == {"clarabel", "scs", "cvxopt"}


@each_solver
@pytest.mark.parametrize(
    ("constraints", "outcome"),
    [
        ([lambda x: x >= 1], Outcome.SOLVED),
        ([lambda x: cp.norm(x) <= 1], Outcome.SOLVED),
        ([lambda x: x >= 1, lambda x: x <= 0], Outcome.INFEASIBLE),
        ([lambda x: cp.norm(x) <= 1, lambda x: x >= 2], Outcome.INFEASIBLE),
        ([lambda x: x <= 1], Outcome.UNBOUNDED),
    ],
    ids=["linear", "cone", "contradiction", "outside the cone", "no bound"],
)
def test_conic_outcomes_are_one_vocabulary(solver, constraints, outcome):
    found, words = conic(least(*constraints), solver)
    assert found is outcome
    assert words.startswith(f"{solver.name}: ")


@each_solver
@pytest.mark.parametrize("level", ACCURACY)
def test_conic_answers_are_as_accurate_as_asked(solver, level):
    problem = least(lambda x: cp.norm(x - 1) <= 1)
    outcome, _ = conic(problem, solver, tolerance=level)
    assert outcome in (Outcome.SOLVED, Outcome.INACCURATE)
    accuracy = max(ACCURACY[level], 1e-7)  # CVXOPT gives no more, and says so in its settings
    assert problem.value == pytest.approx(2 - math.sqrt(2), rel=10 * accuracy)


@each_solver
def test_a_semidefinite_program_is_solved(solver):
    X = cp.Variable((2, 2), symmetric=True)
    problem = cp.Problem(cp.Minimize(cp.trace(X)), [cp.bmat([[X, np.eye(2)], [np.eye(2), X]]) >> 0])
    assert conic(problem, solver)[0] is Outcome.SOLVED
    assert problem.value == pytest.approx(2, rel=1e-5)


class Panic(BaseException):
    """As a Rust panic arrives: no Exception."""


def stub(error):
    """A problem whose solver ends with an error."""

    def solve_via_data(*args, **keywords):
        raise error

    chain = SimpleNamespace(solve_via_data=solve_via_data)
    return SimpleNamespace(get_problem_data=lambda *a, **k: ({}, chain, None))


@pytest.mark.parametrize("error", [Panic("index out of range"), cp.SolverError("no luck")])
def test_whatever_a_solver_raises_is_a_failure_with_its_words(error):
    outcome, words = conic(stub(error), SOLVERS["clarabel"])
    assert outcome is Outcome.FAILED
    assert words == f"{type(error).__name__}: {error}"


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_passes_through_a_solver(error):
    with pytest.raises(error):
        conic(stub(error()), SOLVERS["clarabel"])


def test_a_statement_that_is_not_convex_is_a_failure():
    x = cp.Variable()
    outcome, words = conic(cp.Problem(cp.Minimize(-(x**2))), SOLVERS["clarabel"])
    assert outcome is Outcome.FAILED
    assert "DCP" in words


def test_compilation_is_booked_as_statement():
    context = Context()
    solve_conic(least(lambda x: x >= 1), SOLVERS["clarabel"], Options(), context)
    assert 0 < context.statement_seconds < 10


def large():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(60, 40))
    return least(lambda x: cp.norm(A @ x, 1) <= 1, lambda x: cp.norm(x) <= 1, size=40)


@pytest.mark.parametrize("name", ["clarabel"])
def test_a_conic_solver_stops_at_the_time_limit(name):
    assert conic(large(), SOLVERS[name], time_limit=1e-9)[0] is Outcome.TIME_LIMIT


def test_scs_out_of_time_does_not_call_itself_solved():
    outcome, _ = conic(large(), SOLVERS["scs"], time_limit=1e-9, tolerance="high")
    assert outcome in (Outcome.TIME_LIMIT, Outcome.INACCURATE)


def silence(capfd, call):
    call()
    out, err = capfd.readouterr()
    return out + err


@each_solver
def test_a_conic_solver_prints_only_when_asked(solver, capfd):
    assert silence(capfd, lambda: conic(least(lambda x: x >= 1), solver)) == ""
    assert silence(capfd, lambda: conic(least(lambda x: x >= 1), solver, verbose=True)) != ""


# --- nonlinear --------------------------------------------------------------------------------

x, y = casadi.SX.sym("x"), casadi.SX.sym("y")
VALLEY = {"x": casadi.vertcat(x, y), "f": (1 - x) ** 2 + 100 * (y - x**2) ** 2}


def nonlinear(statement, bounds=None, **options):
    solver = ipopt("test", statement, Options(**options))
    answer = solver(x0=0.5, **(bounds or {}))
    return ipopt_outcome(solver), answer


@pytest.mark.parametrize(
    ("statement", "bounds", "outcome"),
    [
        (VALLEY, {}, Outcome.SOLVED),
        ({"x": x, "f": x, "g": x**2}, {"lbg": -2, "ubg": -1}, Outcome.INFEASIBLE),
        ({"x": x, "f": -(x**2)}, {}, Outcome.UNBOUNDED),
        ({"x": x, "f": casadi.sqrt(x - 1)}, {}, Outcome.FAILED),
    ],
    ids=["valley", "infeasible", "unbounded", "invalid number"],
)
def test_ipopt_outcomes_are_the_same_vocabulary(statement, bounds, outcome):
    (found, words), _ = nonlinear(statement, bounds)
    assert found is outcome
    assert words.startswith("ipopt: ")


def test_ipopt_finds_the_valley():
    _, answer = nonlinear(VALLEY, tolerance="high")
    assert np.allclose(answer["x"].full().ravel(), [1, 1], rtol=0, atol=1e-8)


def test_ipopt_keeps_to_a_bound_at_high_accuracy():
    _, answer = nonlinear({"x": x, "f": x}, {"lbx": 1}, tolerance="high")
    assert float(answer["x"]) == pytest.approx(1, abs=1e-8)


def test_ipopt_stops_at_the_time_limit():
    (outcome, _), _ = nonlinear(VALLEY, time_limit=1e-9)
    assert outcome is Outcome.TIME_LIMIT


def test_ipopt_prints_only_when_asked(capfd):
    assert silence(capfd, lambda: nonlinear(VALLEY)) == ""
    assert "iter" in silence(capfd, lambda: nonlinear(VALLEY, verbose=True))


def test_every_outcome_has_its_word_and_its_advice():
    words = [str(outcome) for outcome in Outcome]
    assert words == [
        *("solved", "inaccurate", "infeasible", "unbounded", "no solution up to R", "no claim"),
        *("time limit", "memory limit", "crashed", "failed"),
    ]
    assert len({outcome.advice for outcome in Outcome}) == len(words)


# --- options ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tolerance", "accuracy"),
    [("low", 1e-3), ("middle", 1e-6), ("high", 1e-9), (1e-4, 1e-4), ("1e-4", 1e-4), ("0.5", 0.5)],
)
def test_a_tolerance_is_a_level_or_a_number(tolerance, accuracy):
    assert Options(tolerance=tolerance).accuracy == accuracy
    assert Options(tolerance=tolerance) == Options(tolerance=accuracy)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tolerance": "hihg"}, "'hihg' is neither a number nor one of low, middle, high"),
        ({"tolerance": 0}, "between 0 and 1"),
        ({"tolerance": 1}, "between 0 and 1"),
        ({"tolerance": -1e-6}, "between 0 and 1"),
        ({"tolerance": math.nan}, "between 0 and 1"),
        ({"tolerance": None}, "tolerance"),
        ({"time_limit": 0}, "time_limit must be positive"),
        ({"time_limit": -1.0}, "time_limit must be positive"),
        ({"time_limit": math.nan}, "time_limit must be positive"),
        ({"time_limit": "soon"}, "time_limit"),
        ({"seed": -1}, "seed must not be negative"),
        ({"seed": 1.5}, "seed"),
        ({"seed": "x"}, "seed"),
    ],
    ids=str,
)
def test_a_bad_option_is_named(options, words):
    with pytest.raises(InputError, match=words):
        Options(**options)


def test_numbers_of_numpy_are_options_too():
    given = Options(tolerance=np.float64(1e-4), time_limit=np.int64(60), seed=np.int64(3))
    assert given == Options(tolerance=1e-4, time_limit=60, seed=3)


def test_versions_cover_every_solver():
    packages = {solver.module for solver in conic_solvers()} | {"casadi", "cvxpy", "scipy"}
    assert {name: version(name) for name in packages}.items() <= versions().items()
