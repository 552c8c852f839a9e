"""Conic statements of circles and of stadiums with a given angle, for every conic solver."""

import numpy as np
import pytest
import xarray as xr
from lanes import thinned

from workbench.conic import ConicProgram
from workbench.errors import InputError, SolverError
from workbench.geometry import (
    NarrowestStadium,
    SmallestCircle,
    conic,
    narrowest_stadium,
    smallest_circle,
)
from workbench.program import method, methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome, conic_solvers

SOLVERS = [solver.name for solver in conic_solvers()]
GIVEN = {"angle": {"angle": 0.7}, "both": {"center": 0.3 - 0.2j, "angle": 0.7}}
SETS = {
    "normal": (np.random.default_rng(0).normal(size=(4, 8, 2)) @ [1, 1j]),
    "far": 1e6 + (np.random.default_rng(1).normal(size=(2, 8, 2)) @ [1, 1j]),
    "tiny": 1e-12 * (np.random.default_rng(2).normal(size=(2, 8, 2)) @ [1, 1j]),
    "duplicates": np.array([[0, 0, 1, 1j, 1j, 0.2 + 0.1j]]),
    "square": np.array([[0, 1, 1j, 1 + 1j]]),
}


def test_every_installed_solver_is_a_method():
    assert SOLVERS == ["clarabel", "scs", "cvxopt"]
    for program in (SmallestCircle, NarrowestStadium):
        assert set(SOLVERS) <= set(methods(program))
        assert all(methods(program)[name].optimal for name in SOLVERS)
        assert all(methods(program)[name].help for name in SOLVERS)


def judged(solution, exact, tolerance):
    """Contained, never below the optimum, and as near to it as is claimed."""
    assert solution.certificate.valid, solution.certificate.failures
    assert np.all(solution.answer.radius >= exact.radius * (1 - 1e-9) - 1e-14)
    if solution.outcome is Outcome.SOLVED:
        assert np.all(solution.answer.radius <= exact.radius * (1 + 2 * tolerance))
    else:
        assert solution.outcome is Outcome.INACCURATE
        assert solution.certificate.gap.value > tolerance


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("sets", SETS)
@pytest.mark.parametrize("level", ["low", "middle"])
def test_circles(solver, sets, level):
    options = Options(tolerance=level)
    program = SmallestCircle(SETS[sets])
    solution = solve(program, method=solver, options=options)
    exact = smallest_circle(SETS[sets])
    judged(solution, exact, options.accuracy)
    assert solution.outcome is Outcome.SOLVED
    assert solution.seconds["statement"] > 0
    near = np.abs(solution.answer.center - exact.center)
    assert np.all(near <= np.sqrt(2 * options.accuracy) * exact.radius)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("case", GIVEN)
@pytest.mark.parametrize("sets", SETS)
@pytest.mark.parametrize("level", thinned(["middle", "low"], 2))
def test_stadiums_of_a_given_angle(solver, case, sets, level):
    options = Options(tolerance=level)
    points, chosen = SETS[sets], dict(GIVEN[case])
    if "center" in chosen:
        size = np.abs(points - points[:, :1]).max()
        chosen["center"] = points[:, 0] + chosen["center"] * size
    solution = solve(NarrowestStadium(points, **chosen), method=solver, options=options)
    exact = narrowest_stadium(points, **chosen)
    if solution.claim is Outcome.FAILED and level != "low":  # CVXOPT gives up on some sets
        assert solver == "cvxopt"
        assert solution.outcome is Outcome.FAILED
        assert "CVXOPT" in solution.message
        assert "at set" in solution.message
        return
    judged(solution, exact, options.accuracy)
    if level == "low":
        assert solution.outcome is Outcome.SOLVED
    np.testing.assert_allclose(solution.answer.angle, exact.angle, atol=1e-12)
    size = exact.radius + exact.half_length
    wide = 4 * np.sqrt(options.accuracy) * size
    assert np.all(np.abs(solution.answer.half_length - exact.half_length) <= wide)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("chosen", [{}, {"center": 1j}])
def test_a_free_angle_does_not_fit(solver, chosen):
    points = SETS["normal"]
    words = f"'{solver}' cannot take this NarrowestStadium: with a free angle it is not convex"
    with pytest.raises(InputError, match=words):
        solve(NarrowestStadium(points, **chosen), method=solver)
    with pytest.raises(InputError, match="give an angle"):
        narrowest_stadium(points, **chosen, method=solver)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("points", [[2 + 1j], [2 + 1j] * 4], ids=["one", "equal"])
@pytest.mark.parametrize("chosen", [{}, {"center": 2 + 1j}])
def test_coincident_points(solver, points, chosen):
    points = np.array(points)
    assert (
        solve(SmallestCircle(points), method=solver, options=Options(tolerance="low")).outcome
        is Outcome.SOLVED
    )
    stadium = solve(
        NarrowestStadium(points, **chosen, angle=1.0),
        method=solver,
        options=Options(tolerance="low"),
    )
    assert stadium.outcome is Outcome.SOLVED


def test_a_set_that_is_refused_is_named_and_lost_alone(monkeypatch):
    solve_conic, calls = conic.solve_conic, []

    def refuse_the_second(problem, solver, options, stopwatch):
        calls.append(solver.name)
        if len(calls) == 2:
            return Outcome.INFEASIBLE, f"{solver.name}: infeasible"
        return solve_conic(problem, solver, options, stopwatch)

    monkeypatch.setattr(conic, "solve_conic", refuse_the_second)
    points = xr.DataArray(
        SETS["normal"][:3],
        dims=("frequency", "drive"),
        coords={"frequency": ("frequency", [10.0, 31.25, 400.0], {"units": "Hz"})},
    )
    solution = solve(SmallestCircle(points), method="clarabel")
    assert solution.claim is Outcome.INFEASIBLE
    assert solution.message == "clarabel: infeasible at frequency 31.25 Hz"
    assert solution.outcome is Outcome.FAILED
    assert np.isnan(solution.answer.radius).tolist() == [False, True, False]
    assert solution.certificate.checks[0].where == "at frequency 31.25 Hz"
    calls.clear()
    with pytest.raises(SolverError, match=r"infeasible at frequency 31"):
        smallest_circle(points, method="clarabel")


@pytest.mark.parametrize("level", ["low", "middle"])
def test_batches(level):
    points = SETS["normal"].reshape(2, 2, 8)
    solution = solve(SmallestCircle(points), method="clarabel", options=Options(tolerance=level))
    assert solution.answer.radius.shape == (2, 2)
    assert solution.outcome is Outcome.SOLVED
    single = smallest_circle(points[0, 1], method="clarabel", options=Options(tolerance=level))
    assert single.radius.shape == ()
    assert single.radius == pytest.approx(solution.answer.radius[0, 1], rel=1e-9)


def test_the_data_of_the_conic_program_are_those_of_the_circle():
    points = np.random.default_rng(4).normal(size=(3, 9, 2)) @ [1.0, 1j] + 2.0
    program = SmallestCircle(points)
    by_data = solve(ConicProgram(program.conic_form()))
    assert by_data.outcome is Outcome.SOLVED
    found = by_data.answer["x"].values.reshape(3, 3)
    exact = solve(program, method="exact").answer
    np.testing.assert_allclose(found[:, 2], exact.radius, rtol=1e-6)
    np.testing.assert_allclose(found[:, :2] @ [1.0, 1j], exact.center, atol=1e-3)


@pytest.mark.parametrize("claim", [Outcome.INFEASIBLE, Outcome.UNBOUNDED])
def test_no_claim_that_a_circle_does_not_exist_is_proven(claim):
    points = np.random.default_rng(5).normal(size=(6, 2)) @ [1.0, 1j] + 20.0

    class Denied(SmallestCircle):
        pass

    @method(Denied, "denial", optimal=True)
    def denial(program, context):
        return None, claim, "none"

    solution = solve(Denied(points), method="denial")
    assert solution.outcome in (Outcome.NO_CLAIM, Outcome.NONE_UP_TO_R)
    if solution.proof is not None and solution.certificate is not None:
        assert solution.proof.metrics(solution.answer)["radius"] <= abs(points).max()
