"""Objectives of the Programs, and the lower bounds that their gaps prove."""

import math

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from scipy.linalg import expm

from workbench.fitting import MagnitudeFit, ResponseFit
from workbench.fitting.magnitude.program import MATCHED_ERROR
from workbench.fitting.rational import Rational
from workbench.geometry import (
    Circle,
    NarrowestStadium,
    SmallestAreaStadium,
    SmallestCircle,
    Stadium,
)
from workbench.identification import CrestFactor, FittedParameter, MeasuredResponse, ParameterFit
from workbench.mu import MuLowerBound, MuUpperBound
from workbench.program import Program
from workbench.solution import solve
from workbench.structure import Full, Structure
from workbench.synthesis import Dwell, LoopShaping, Mode, SwitchedStability

OMEGA = np.geomspace(0.1, 100.0, 25)
POINTS = np.random.default_rng(1).standard_normal((3, 7, 2)) @ np.array([1.0, 0.4j]) + 2.0


def bound(program, answer):
    return program.lower_bound(answer, program.gap(answer)[1])


def larger(answer, factor):
    """A circle or a stadium whose radius is larger, so that it still contains its points."""
    shape = {name: getattr(answer, name) for name in ("center", "radius", "half_length", "angle")}
    shape["radius"] = shape["radius"] * factor
    return Circle(shape["center"], shape["radius"]) if type(answer) is Circle else Stadium(**shape)


@pytest.mark.parametrize("kind", [SmallestCircle, NarrowestStadium])
@examples(5, 20)
@given(factor=st.floats(1.0, 1e3))
def test_no_shape_is_smaller_than_the_bound_of_a_larger_one(kind, factor):
    program = kind(POINTS)
    best = solve(program).answer
    worse = larger(best, factor)
    least = program.objective(best)
    assert bound(program, worse) <= least
    assert bound(program, best) == pytest.approx(least, rel=1e-8)
    assert program.objective(worse) >= least


def test_the_area_of_a_stadium_has_a_bound_of_its_own():
    program = SmallestAreaStadium(POINTS[0])
    best = solve(program).answer
    assert program.objective(best) == best.area
    assert bound(program, best) == pytest.approx(best.area, rel=1e-8)
    assert bound(program, larger(best, 1.2)) <= best.area


def test_the_objective_of_a_batch_is_the_sum_over_its_sets():
    whole = SmallestCircle(POINTS)
    parts = [SmallestCircle(points) for points in POINTS]
    sizes = [part.objective(solve(part).answer) for part in parts]
    assert whole.objective(solve(whole).answer) == pytest.approx(sum(sizes))
    assert whole.problem_size == sum(part.problem_size for part in parts) == 21


def test_rounding_of_far_points_is_taken_off_the_bound():
    """Points a billion radii away have rounding errors that no gap shows."""
    program = SmallestCircle(1e9 + np.array([0.0, 1.0, 1.0j]))
    answer = solve(program).answer
    assert program.objective_rounding(answer) == pytest.approx(8 * 2.0**-52 * 1e9)
    assert bound(program, answer) < program.objective(answer) - 1e-6


@pytest.mark.cases(1)
@pytest.mark.parametrize("cover", [False, True])
def test_no_fit_is_better_than_the_bound_of_a_worse_one(cover):
    magnitude = 1 / np.sqrt(1 + (OMEGA / 3.0) ** 3)
    program = MagnitudeFit(OMEGA, magnitude, 2, cover=cover)
    best = solve(program).answer
    least = program.objective(best)
    assert least == program.metrics(best)["error_worst"]
    assert program.lower_bound(best, program.gap(best)[1]) == pytest.approx(least, rel=1e-5)
    worse = Rational(best.zeros, best.poles, 1.05 * best.gain)
    assert program.objective(worse) > least >= bound(program, worse)


def test_fits_that_match_their_data_have_the_same_objective():
    program = MagnitudeFit(OMEGA, np.full(25, 2.0), 0)
    exact, near = (Rational(np.array([]), np.array([]), 2.0 * (1 + off)) for off in (0.0, 1e-10))
    assert program.error(near) > program.error(exact)
    assert program.objective(exact) == program.objective(near) == MATCHED_ERROR
    assert bound(program, near) == bound(program, exact) == pytest.approx(MATCHED_ERROR)


def test_the_bound_of_a_dwell_time_is_the_shortest_that_no_switching_excludes():
    first, second = np.array([[0.0, 1.0], [-10.0, -1.0]]), np.array([[0.0, 1.0], [-0.1, -0.5]])
    program = SwitchedStability(
        (
            Mode("first", expm(0.5 * first), shortest_samples=None),
            Mode("second", expm(0.5 * second), shortest_samples=None),
        )
    )
    for samples in (6, 60, 600):
        answer = Dwell(samples, np.array([np.eye(2)] * 2))
        assert program.objective(answer) == samples
        assert bound(program, answer) == pytest.approx(6.0)
    assert program.problem_size == 6  # two symmetric matrices of order 2


def test_the_bound_of_loop_shaping_is_the_least_norm():
    program = LoopShaping(control.tf([1.0], [1.0, 0.0]))
    answer = solve(program).answer
    assert bound(program, answer) == pytest.approx(math.sqrt(2))  # closed form of an integrator
    assert program.objective(answer) == answer.norm > math.sqrt(2)
    assert LoopShaping(control.tf([1.0], [1.0, 0.0]), gamma=2.0).objective(answer) is None


def test_bounds_of_mu_are_minimised_from_above_and_maximised_from_below():
    M = np.array([np.eye(2), np.diag([2.0, 3.0])])
    structure = Structure([Full(2, 2)])
    upper, lower = MuUpperBound(M, structure), MuLowerBound(M, structure)
    assert upper.objective(solve(upper).answer) == pytest.approx(4.0, rel=1e-5)
    assert lower.objective(solve(lower).answer) == pytest.approx(-4.0, rel=1e-5)
    assert upper.problem_size == lower.problem_size == 8


def test_a_limit_on_the_error_leaves_no_objective():
    values = 1 / (1j * OMEGA + 5)
    answer = Rational(np.array([]), np.array([-5.0]), 1.1)
    free = ResponseFit(OMEGA, values, 1)
    assert free.objective(answer) == pytest.approx(0.1)
    assert ResponseFit(OMEGA, values, 1, error=0.2).objective(answer) is None
    assert free.problem_size == 25


def test_the_objective_of_a_parameter_fit_is_its_sum_of_squares():
    def constant(values, s):
        return values["gain"] + 0 * s

    data = MeasuredResponse(constant, OMEGA, np.full(25, 3.0 + 0j))
    program = ParameterFit([data], {"gain": FittedParameter(1.0, lower=0.1, upper=10.0)})
    residuals = program.residuals(np.array([2.0]))
    assert program.objective(np.array([2.0])) == pytest.approx(residuals @ residuals)
    assert program.problem_size == 50  # real and imaginary parts


def test_the_objective_of_a_multisine_is_its_crest_factor():
    program = CrestFactor(1.0, [1, 2, 3], 64)
    phases = np.zeros(3)
    assert program.objective(phases) == program.metrics(phases)["crest_factor"]
    assert program.objective(phases) == pytest.approx(3 / math.sqrt(1.5), rel=1e-2)
    assert program.problem_size == 3


def test_a_program_without_an_objective_has_no_bound():
    class Plain(Program):
        def checks(self, answer, tolerance):
            return []

        def metrics(self, answer):
            return {}

    plain = Plain()
    assert plain.objective(1.0) is plain.problem_size is plain.lower_bound(1.0, 0.0) is None
