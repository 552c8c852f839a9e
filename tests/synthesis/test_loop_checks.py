"""Mixed sensitivity and loop shaping."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.synthesis import HinfController, LoopShaping, MixedSensitivity

s = control.tf("s")
WIDE = control.ss([], [], [], [[1.0, 1.0]])
DISTURBED = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)


def random_system(seed, dt=0.0):
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 6), rng.integers(1, 4), rng.integers(1, 4)
    A = rng.normal(size=(n, n)) * (0.5 if dt else 1.0)
    B, C, D = rng.normal(size=(n, m)), rng.normal(size=(p, n)), rng.normal(size=(p, m))
    return control.ss(A, B, C, D * rng.integers(2), dt)


def test_mixed_sensitivity_of_a_textbook():
    """Skogestad, Postlethwaite, Multivariable Feedback Control (1996), example 2.11: 1.37."""
    program = MixedSensitivity(DISTURBED, W_S=(s / 1.5 + 10) / (s + 1e-3), W_KS=1.0)
    solution = solve(program)
    assert solution.certificate.holds
    assert solution.answer.norm == pytest.approx(1.37, abs=0.005)
    # The loop closes with negative feedback of K.
    loop = control.feedback(DISTURBED * control.ss2tf(solution.answer.K), 1)
    assert np.all(loop.poles().real < 0)


def test_every_row_of_several_channels():
    program = MixedSensitivity(random_system(5), W_S=(s + 10) / (10 * s + 1), W_KS=0.1, W_T=0.2)
    p, m = program.nominal.noutputs, program.nominal.ninputs
    assert program.plant.performance == 2 * p + m
    assert solve(program).certificate.holds


def test_a_controller_of_another_plant_does_not_fit_the_definition():
    program = MixedSensitivity(1 / (s + 1), W_S=(s + 1) / (s + 0.1), W_KS=0.1)
    other = solve(MixedSensitivity(-1 / (s + 1), W_S=(s + 1) / (s + 0.1), W_KS=0.1)).answer
    assert program.certify(other, 1e-6).outcome is Outcome.FAILED


@pytest.mark.parametrize("a", [-2.0, 0.0, 3.0])
def test_the_margin_of_one_over_s_minus_a(a):
    """X = Z = a + sqrt(a^2 + 1) and epsilon_max = 1 / sqrt(1 + X^2)."""
    program = LoopShaping(1 / (s - a))
    expected = 1 / np.sqrt(1 + (a + np.sqrt(a**2 + 1)) ** 2)
    assert program.epsilon_max == pytest.approx(expected, rel=1e-9)
    solution = solve(program)
    assert solution.certificate.holds
    assert solution.answer.norm == pytest.approx(1 / expected, rel=2e-3)
    assert solution.answer.norm >= (1 - 1e-9) / expected


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("seed", range(8))
def test_the_closed_form_is_the_hankel_norm_and_the_general_synthesis(seed, dt):
    program = LoopShaping(random_system(seed, dt))
    found = solve(program)
    assert found.certificate.holds
    least = float(found.message.split()[-1])
    rounding = 1e-10 * least**2  # epsilon_max is a root of a difference of numbers near 1
    assert least * program.epsilon_max == pytest.approx(1.0, rel=1e-6 + rounding)
    general = solve(program, method="riccati")
    assert general.certificate.holds
    assert general.answer.norm == pytest.approx(found.answer.norm, rel=2e-3)


def test_weights_become_part_of_the_controller():
    program = LoopShaping(DISTURBED, W1=(s + 2) / s, W2=0.5)
    solution = solve(program)
    assert solution.certificate.holds
    K = program.controller(solution.answer)
    assert np.min(np.abs(K.poles())) == pytest.approx(0.0, abs=1e-9)
    loop = control.feedback(control.ss(DISTURBED) * K, 1)
    assert np.all(loop.poles().real < 0)
    assert program.metrics(solution.answer)["epsilon"] <= program.epsilon_max * (1 + 1e-6)


def test_a_claim_beyond_the_largest_margin_fails():
    program = LoopShaping(1 / s)
    answer = solve(program).answer
    claim = HinfController(answer.K, answer.norm * 0.99, answer.gamma)
    assert program.certify(claim, 1e-6).outcome is Outcome.FAILED


def test_a_level_that_cannot_be_had():
    assert solve(LoopShaping(1 / s, gamma=1.4)).claim is Outcome.INFEASIBLE
    assert solve(LoopShaping(1 / s, gamma=1.5)).certificate.holds


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MixedSensitivity(1 / (s + 1)), "no weight"),
        (lambda: MixedSensitivity("G", W_S=1.0), "nominal must be"),
        (lambda: MixedSensitivity(s, W_S=1.0, W_KS=1.0), "realisation"),
        (lambda: MixedSensitivity(1 / (s + 1), W_S=WIDE, W_KS=1.0), "inputs"),
        (lambda: MixedSensitivity(1 / (s + 1), W_S="W", W_KS=1.0), "W_S must be"),
        (lambda: LoopShaping(1 / s, W1=1.0, W2=WIDE), "inputs"),
        (lambda: LoopShaping(1 / s, W1=control.ss([], [], [], np.ones((2, 1)))), "outputs"),
        (lambda: LoopShaping(control.ss([[np.nan]], [[1]], [[1]], [[0]])), "finite"),
        (lambda: LoopShaping(1 / s, gamma=-1.0), "gamma"),
    ],
)
def test_bad_input_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
