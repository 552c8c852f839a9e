"""Certificates of magnitude fits: what they accept, and that they reject everything worse."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.fitting.magnitude.coverage import least_margin
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.magnitude.sb10yd import minimum_phase
from workbench.fitting.rational import Rational
from workbench.solution import solve
from workbench.solvers import Options, Outcome

OMEGA = np.geomspace(1, 1e4, 200)
STEPPED = np.where(OMEGA < 100, 1.0, 3.0)
V = np.exp(np.abs(np.log(OMEGA / 100)) / 2)


def test_the_best_constant_is_known():
    program = MagnitudeFit(OMEGA, STEPPED, 0)
    answer = solve(program).answer
    assert answer.gain == pytest.approx(1.5)
    assert program.error(answer) == pytest.approx(0.5)
    assert program.bound(answer) == pytest.approx(0.5)
    off = answer.scaled(1.1)  # the bound does not depend on the gain, the gap does
    assert program.bound(off) == pytest.approx(0.5)
    assert program.gap(off)[1] == pytest.approx((0.65 - 0.5) / 0.65)


def test_the_best_constant_of_weighted_data_is_known():
    program = MagnitudeFit([1.0, 2.0], [1.0, 2.0], 0, weight=[3.0, 1.0])
    answer = solve(program).answer
    assert answer.gain == pytest.approx(8 / 7)  # 3 (g - 1) = 1 - g / 2
    assert program.gap(answer)[1] == pytest.approx(0, abs=1e-12)


def test_an_error_equioscillating_at_given_points_is_proven_best():
    """Data made so that a chosen W is the best fit of its order."""
    truth = Rational([-30.0, -900.0], [-5.0, -200.0], 1.0)
    ripple = 0.1 * np.cos(5 * np.pi * np.linspace(0, 1, OMEGA.size))  # 6 extremes = 2 n + 2
    magnitude = np.abs(truth.response(OMEGA)) / (1 + ripple)
    program = MagnitudeFit(OMEGA, magnitude, 2)
    assert program.error(truth) == pytest.approx(0.1)
    assert program.gap(truth)[1] == pytest.approx(0, abs=2e-3)  # extremes lie on the grid, nearly
    found = solve(program).answer
    assert program.error(found) == pytest.approx(0.1, rel=2e-3)
    assert program.gap(found)[1] <= 1e-9


def test_bounds_of_any_fit_are_below_the_optimum():
    program = MagnitudeFit(OMEGA, V, 3)
    least = program.error(solve(program).answer)
    rng = np.random.default_rng(3)
    for _ in range(50):
        fit = Rational(-(10 ** rng.uniform(0, 4, 3)), -(10 ** rng.uniform(0, 4, 3)), 1.0)
        assert program.bound(fit) <= least * (1 + 1e-9)
    for method in ("sk", "sb10yd", "ipopt"):
        assert program.bound(solve(program, method=method).answer) <= least * (1 + 1e-9)


@pytest.mark.parametrize(
    ("answer", "failed"),
    [
        (Rational([-1.0], [2.0], 1.0), "stable"),
        (Rational([-1.0], [0.0], 1.0), "stable"),
        (Rational([1.0], [-2.0], 1.0), "minimum phase"),
        (Rational([-1.0, -2.0], [-1.0, -2.0], 1.0), "order"),
        (Rational([-1.0], [-2.0], 1e-3), "cover"),
    ],
)
def test_bad_answers_are_rejected(answer, failed):
    certificate = MagnitudeFit(OMEGA, V, 1, cover=True).certify(answer, 1e-6)
    assert failed in [check.name for check in certificate.checks if not check.holds]
    assert not certificate.valid


def test_a_notch_between_the_data_is_found():
    place = np.sqrt(OMEGA[100] * OMEGA[101])
    roots = place * np.array([-1 + 1j, -1 - 1j]) / np.sqrt(2)
    for damping in (1e-3, 1e-6):
        notch = place * (-damping + 1j * np.array([1, -1]) * np.sqrt(1 - damping**2))
        fit = Rational(notch, roots, 1e3)
        margin, where = least_margin(OMEGA, np.ones(OMEGA.size), fit)
        depth = np.log(np.abs(fit.response(place)))
        assert (margin < 0) == (depth < 0)
        if depth < 0:
            assert where == pytest.approx(place, rel=1e-2)
        assert margin <= depth + 1e-9


def test_coverage_margins_are_tight():
    fit = Rational([-10.0], [-1000.0], 1.0)
    data = np.abs(fit.response(OMEGA)) * (1 - 1e-7)
    margin, _ = least_margin(OMEGA, data, fit)
    fine = np.geomspace(OMEGA[0], OMEGA[-1], 40001)
    level = np.interp(np.log(fine), np.log(OMEGA), np.log(data))
    seen = float(np.min(np.log(np.abs(fit.response(fine))) - level))
    assert margin <= seen + 1e-12
    assert (margin < 0) == (seen < 0)


def test_order_more_than_the_data_need_is_matched():
    magnitude = np.abs(Rational([-10.0], [-1000.0], 1.0).response(OMEGA))
    solution = solve(MagnitudeFit(OMEGA, magnitude, 3), options=Options(tolerance="high"))
    assert solution.outcome is Outcome.SOLVED
    assert solution.certificate.gap.value == 0


@pytest.mark.parametrize("order", [1, 3])
def test_a_degenerate_optimum_is_proven(order):
    """A symmetric V has no use for an odd order: whether a root more is kept is for rounding."""
    program, lower = (MagnitudeFit(OMEGA, V, each) for each in (order, order - 1))
    solution = solve(program, method="minimax")
    assert solution.outcome is Outcome.SOLVED, solution.certificate
    least = lower.error(solve(lower, method="minimax").answer)
    assert program.error(solution.answer) == pytest.approx(least, rel=1e-4)


def test_an_optimum_at_infinity_is_proven():
    """Magnitudes that fall faster and faster ask for a zero at infinity."""
    magnitude = np.exp(-((OMEGA / 3e3) ** 2)) / (1 + OMEGA / 30)
    program = MagnitudeFit(OMEGA, magnitude, 2)
    solution = solve(program)
    assert solution.outcome is Outcome.SOLVED, solution.certificate


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_clarabel_is_proven_optimal(order):
    solution = solve(MagnitudeFit(OMEGA, V, order), method="clarabel")
    assert solution.outcome is Outcome.SOLVED, solution.certificate


def test_large_orders_are_no_conic_programs():
    with pytest.raises(InputError, match="Gram matrices"):
        solve(MagnitudeFit(OMEGA, V, 9), method="clarabel")


def test_the_minimum_phase_is_that_of_a_rational_function():
    fit = Rational([-10.0, -500.0], [-100.0, -2000.0], 2.0)
    omega = np.geomspace(1e-1, 1e6, 400)
    response = fit.response(omega)
    phase = minimum_phase(omega, np.abs(response))
    np.testing.assert_allclose(phase, np.angle(response), atol=2e-3)


def test_frequencies_that_differ_by_rounding_leave_the_phase_as_it_is():
    omega = np.geomspace(0.1, 100, 60)
    again = np.insert(omega, 50, np.nextafter(omega[50], 0))
    assert np.log(again[50]) == np.log(again[51])
    once, twice = (minimum_phase(w, 1 / np.hypot(w, 1)) for w in (omega, again))
    np.testing.assert_allclose(np.delete(twice, 50), once, atol=1e-10)
