"""Fits of complex responses: what the methods find, and that none is worse than SB10YD's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples, thinned
from workbench.plants.cd_drive.drive import plants as drives

import workbench.fitting.response.best  # noqa: F401  registers the methods
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.geometry import narrowest_stadium, smallest_circle
from workbench.program import find_method, methods
from workbench.solution import solve
from workbench.solvers import conic_solvers

OMEGA = np.geomspace(1, 1e5, 200)
DRIVE_OMEGA = 2 * np.pi * np.geomspace(5, 5000, 400)
CONIC = [solver.name for solver in conic_solvers()]
WITHOUT_PEER = ["vector-fitting", "ipopt", "best"]


def random_rational(seed, order, decades=5):
    """Poles and zeros over the decades from 1 rad/s, pairs damped from 0.003 to 0.8."""
    rng = np.random.default_rng(seed)
    zeros = _roots(rng, rng.integers(0, order + 1), decades)
    right = rng.random() < 0.3
    return Rational(
        -zeros.conj() if right else zeros, _roots(rng, order, decades), 10 ** rng.uniform(-3, 3)
    )


def _roots(rng, count, decades):
    found = []
    while len(found) < count:
        size = 10 ** rng.uniform(0.3, decades - 0.3, 2)
        if count - len(found) > 1 and rng.random() < 0.65:
            damping = 10 ** rng.uniform(-2.5, -0.1)
            root = size[0] * complex(-damping, np.sqrt(1 - damping**2))
            found += [root, root.conjugate()]
        else:
            found.append(-size[1])
    return np.array(found, dtype=complex)


def noisy(rational, omega, level, seed):
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size)
    return rational.response(omega) * (1 + level * noise)


def drive_responses(axis):
    return drives.responses(axis, DRIVE_OMEGA / (2 * np.pi), antialiasing=False)


def error(program, method=None):
    """Worst error of a valid answer."""
    solution = solve(program, method=method)
    assert solution.certificate is not None, solution.message + solution.trace
    assert solution.certificate.failures == ()
    return program.metrics(solution.answer)["error_worst"]


def peer_error(program):
    """Worst error of SB10YD's answer, valid or not."""
    return program.metrics(solve(program, method="sb10yd").answer)["error_worst"]


# --- data that a rational function of the order made ----------------------------------------------


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_drives_are_recovered(axis):
    for response in drive_responses(axis):
        program = ResponseFit(DRIVE_OMEGA, response, 4, zeros=2)
        assert error(program, "vector-fitting") < 1e-12


@pytest.mark.parametrize("order", thinned(range(1, 11), 3))
def test_random_functions_are_recovered(order):
    for seed in range(4):
        truth = random_rational(100 * order + seed, order)
        program = ResponseFit(OMEGA, truth.response(OMEGA), order)
        assert error(program, "vector-fitting") < 1e-9


@pytest.mark.parametrize("order", thinned([1, 2, 4, 7, 10], 2))
def test_recovered_at_the_relative_degree_asked_for(order):
    truth = random_rational(order, order)
    zeros = truth.zeros.size
    program = ResponseFit(OMEGA, truth.response(OMEGA), order, zeros=zeros)
    solution = solve(program)
    assert solution.answer.zeros.size <= zeros
    assert solution.certificate.valid
    assert program.metrics(solution.answer)["error_worst"] < 1e-9


@pytest.mark.parametrize("method", [*WITHOUT_PEER, *CONIC])
@pytest.mark.parametrize("order", [0, 1, 3])
def test_every_method_recovers(method, order):
    truth = random_rational(order, order)
    assert error(ResponseFit(OMEGA, truth.response(OMEGA), order), method) < 1e-9


def test_unstable_functions_are_recovered_only_where_allowed():
    truth = Rational([-30.0], [20 + 100j, 20 - 100j, -1e3], 5.0)
    response = truth.response(OMEGA)
    assert error(ResponseFit(OMEGA, response, 3, stable=False)) < 1e-9
    assert error(ResponseFit(OMEGA, response, 3)) > 0.5  # and yet valid: stable


def test_constants():
    assert error(ResponseFit(OMEGA, np.full(OMEGA.size, -3.0), 0)) < 1e-15
    zero = ResponseFit(OMEGA, np.zeros(OMEGA.size), 2, weight=np.ones(OMEGA.size))
    assert error(zero) == 0


def test_more_poles_than_the_data_have():
    truth = random_rational(3, 3)
    for order in (4, 6, 8):
        assert error(ResponseFit(OMEGA, truth.response(OMEGA), order)) < 1e-9


def test_as_many_coefficients_as_data():
    omega = np.array([1.0, 2.0, 5.0])
    response = np.array([1.0, 0.8 - 0.4j, 0.3 - 0.5j])
    program = ResponseFit(omega, response, 3, zeros=2)
    assert error(program) < 0.5


# --- data that none made --------------------------------------------------------------------------


@pytest.mark.parametrize("axis", ["focus", "radial"])
@pytest.mark.parametrize("order", thinned([4, 5], 2))
@pytest.mark.parametrize("cover", [smallest_circle, narrowest_stadium])
def test_centres_of_the_drives(axis, order, cover):
    center = cover(drive_responses(axis).T).center
    program = ResponseFit(DRIVE_OMEGA, center, order)
    best = error(program)
    assert best <= error(program, "vector-fitting")
    assert best < 0.4
    assert best < peer_error(program)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_noise_is_not_amplified(order):
    truth = random_rational(order, order)
    program = ResponseFit(OMEGA, noisy(truth, OMEGA, 0.02, order), order)
    best = error(program)
    assert best < program.metrics(truth)["error_worst"]  # the minimax fit beats the truth
    assert best <= min(error(program, "vector-fitting"), peer_error(program))


def test_conic_methods_agree_and_improve_on_the_vector_fit():
    program = ResponseFit(OMEGA, noisy(random_rational(3, 3), OMEGA, 0.02, 0), 3)
    errors = [error(program, name) for name in CONIC]
    assert max(errors) <= min(errors) * (1 + 1e-3)
    assert max(errors) <= error(program, "vector-fitting") * (1 + 1e-6)


@pytest.mark.parametrize("seed", thinned(range(4), 4))
def test_minimum_phase_on_request(seed):
    order = 2 + seed
    truth = random_rational(seed, order)
    truth = Rational(-abs(truth.zeros.real) + 1j * truth.zeros.imag, truth.poles, truth.gain)
    program = ResponseFit(OMEGA, noisy(truth, OMEGA, 0.02, seed), order, minimum_phase=True)
    best = error(program)
    assert best <= peer_error(program)
    assert best < 0.1


def test_minimum_phase_of_data_that_are_not():
    truth = Rational([200.0], [-10.0, -1e3], 1.0)
    program = ResponseFit(OMEGA, truth.response(OMEGA), 2, minimum_phase=True)
    assert error(program) <= min(1.0, peer_error(program))


def test_absolute_errors_of_data_with_zeros():
    response = 1 / (1 + 1j * OMEGA / 300)
    response[20] = response[90:95] = 0
    program = ResponseFit(OMEGA, response, 3, weight=np.ones(OMEGA.size))
    assert "the response is zero at" in solve(program).message
    assert error(program) < 0.6


def test_weights_choose_where_the_error_is_small():
    truth = random_rational(5, 5)
    response = truth.response(OMEGA)
    low = OMEGA < 1e3
    ignored = ResponseFit(OMEGA, np.where(low, response, 1e9), 5, weight=low / np.abs(response))
    assert error(ignored) < 1e-6  # what has no weight is not looked at
    spread = np.where(low, 1e4, 1e-4) / np.abs(response)
    program = ResponseFit(OMEGA, response, 3, weight=spread)
    answer = solve(program).answer
    errors = np.abs(answer.response(OMEGA) / response - 1)
    assert errors[low].max() < 1e-3 * errors[~low].max()


# --- invariance -----------------------------------------------------------------------------------

FITTED = noisy(random_rational(3, 3), OMEGA, 0.02, 0)


@examples(8, 15)
@given(st.integers(-30, 30), st.integers(-60, 60), st.booleans())
def test_units_of_time_and_gain_do_not_matter(time, gain, negative):
    factor = -(2.0**gain) if negative else 2.0**gain
    here = ResponseFit(OMEGA, FITTED, 3)
    there = ResponseFit(OMEGA * 2.0**time, FITTED * factor, 3)
    assert error(there, "vector-fitting") == pytest.approx(error(here, "vector-fitting"), rel=1e-3)


@examples(6, 15)
@given(st.integers(0, 10**6), st.integers(1, 6), st.integers(0, 6), st.booleans())
def test_always_valid(seed, order, zeros, minimum_phase):
    rng = np.random.default_rng(seed)
    omega = np.unique(10 ** rng.uniform(-2, 3, 40))
    response = rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size)
    program = ResponseFit(
        omega, response, order, minimum_phase=minimum_phase, zeros=min(zeros, order)
    )
    assert np.isfinite(error(program, "vector-fitting"))


@pytest.mark.parametrize("seed", [1, 34, 240, *thinned(range(1000, 1100), 100)])
def test_noise_gives_no_roots_that_doubles_cannot_realise(seed):
    """Roots of unlimited fits: 1e18 times the last frequency, 1e-35 times the first."""
    rng = np.random.default_rng(seed)
    omega = np.unique(10 ** rng.uniform(-2, 3, 40))
    response = rng.normal(size=omega.size) + 1j * rng.normal(size=omega.size)
    order, zeros = rng.integers(1, 7, 2)
    minimum_phase = bool(rng.integers(2))
    program = ResponseFit(
        omega, response, int(order), minimum_phase=minimum_phase, zeros=int(min(zeros, order))
    )
    assert np.isfinite(error(program, "vector-fitting"))


# --- what a method cannot take --------------------------------------------------------------------


def test_methods_that_cannot_say_why():
    response = random_rational(2, 2).response(OMEGA)
    assert set(WITHOUT_PEER + CONIC + ["sb10yd"]) == set(methods(ResponseFit))
    with pytest.raises(InputError, match="minimum phase is not convex"):
        find_method(ResponseFit(OMEGA, response, 2, minimum_phase=True), CONIC[0])
    with pytest.raises(InputError, match="as many zeros as poles; 1 at most"):
        find_method(ResponseFit(OMEGA, response, 2, zeros=1), "sb10yd")


def test_best_says_what_it_chose():
    program = ResponseFit(OMEGA, FITTED, 3)
    solution = solve(program)
    assert solution.message.startswith("vector-fitting chosen; vector-fitting 0.")
    assert "sb10yd" in solution.message
