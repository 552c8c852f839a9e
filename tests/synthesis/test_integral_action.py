"""Integrators to the last bit, made of poles near zero, and the peaks certified with them."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import PI, MuSynthesis
from workbench.synthesis.families.integral_action import (
    integral_check,
    integrators,
    with_integrator,
    without_integrators,
)
from workbench.uncertainty import UncertaintyModel, generalised_plant

s = control.tf("s")
MODEL = UncertaintyModel(1.0 / (2 * s + 1), 0.2 * (1 + 2 * s) / (1 + 0.2 * s))


def weighted(bandwidth, leak):
    W_e = control.tf([0.5, bandwidth], [1, leak * bandwidth])
    W_u = control.tf([0.02 / 30, 0.02], [0.01 / 30, 1])
    return generalised_plant(
        [(MODEL, "u", "y"), (W_e, "e", "z_e"), (W_u, "u", "z_u")],
        {"e": "r - y"},
        exogenous="r",
        control="u",
        performance=["z_e", "z_u"],
        measurement="e",
    )


@settings(deadline=None, derandomize=True, max_examples=30)
@given(st.integers(1, 6), st.integers(0, 1000))
def test_the_slowest_real_pole_moves_and_nothing_else(states, seed):
    rng = np.random.default_rng(seed)
    fast = rng.normal(size=(states, states)) - 3 * states * np.eye(states)
    B, C = rng.normal(size=(states + 1, 1)), rng.normal(size=(1, states + 1))
    turn = np.linalg.qr(rng.normal(size=(states + 1, states + 1)))[0]
    A = np.block([[-1e-9, np.zeros((1, states))], [np.zeros((states, 1)), fast]])
    given_K = control.ss(turn @ A @ turn.T, turn @ B, C @ turn.T, [[0.3]])
    K = with_integrator(given_K)
    assert integrators(K.A) == 1 and integral_check(K).holds
    assert not integral_check(given_K).holds
    omega = np.geomspace(1e-2, 1e2, 20)
    assert K(1j * omega) == pytest.approx(given_K(1j * omega), rel=1e-5)
    assert without_integrators(K).nstates == states
    assert with_integrator(K) is K


def test_a_controller_without_a_real_pole_stays():
    K = control.ss([[-1.0, 2.0], [-2.0, -1.0]], [[1.0], [0.0]], [[1.0, 0.0]], 0.0)
    assert with_integrator(K) is K


def test_a_slow_pair_becomes_two_integrators():
    """Poles of the weights of two channels may come out as a pair; the next real pole is none."""
    rng = np.random.default_rng(5)
    A = np.zeros((5, 5))
    A[:2, :2] = [[-1e-9, 2e-9], [-2e-9, -1e-9]]
    A[2:, 2:] = np.diag([-1e-3, -0.1, -3.0])
    turn = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    B, C = rng.normal(size=(5, 2)), rng.normal(size=(2, 5))
    given_K = control.ss(turn @ A @ turn.T, turn @ B, C @ turn.T, np.zeros((2, 2)))
    K = with_integrator(given_K)
    assert integrators(K.A) == 2 and integral_check(K).holds
    omega = np.geomspace(1e-2, 1e2, 20)
    assert K(1j * omega) == pytest.approx(given_K(1j * omega), rel=1e-5)


def test_each_channel_gets_an_integrator_of_its_own():
    rng = np.random.default_rng(4)
    A = np.diag([-1e-9, -2e-9, -3.0, -5.0]) + np.diag([0.0, 0.0, 1.0], 1)
    turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    B, C = rng.normal(size=(4, 2)), rng.normal(size=(2, 4))
    given_K = control.ss(turn @ A @ turn.T, turn @ B, C @ turn.T, np.zeros((2, 2)))
    K = with_integrator(given_K)
    assert integrators(K.A) == 2 and integral_check(K).holds
    assert not integral_check(given_K).holds
    omega = np.geomspace(1e-2, 1e2, 20)
    assert K(1j * omega) == pytest.approx(given_K(1j * omega), rel=1e-5)
    assert np.linalg.matrix_rank(np.asarray(K.C)[:, :2] @ np.asarray(K.B)[:2]) == 2


@pytest.mark.cases(0)
def test_integral_action_is_certified_and_costs_little():
    without = wb.solve(MuSynthesis(weighted(0.9, 0.01))).answer
    best = None
    for more in ({}, {"order": 2, "stable": True}, {"target": 1.0}):
        done = wb.solve(MuSynthesis(weighted(0.9, 1e-6), integral=True, **more))
        assert done.certificate.holds, done.certificate
        assert any(check.name == "integral action" for check in done.certificate.checks)
        assert integrators(done.answer.lti.A) == 1
        assert done.answer.upper < 1.0
        best = best or done.answer  # the first, of which nothing else is asked
    assert best.upper < 1.02 * without.upper


@pytest.mark.cases(0)
def test_a_pi_has_it_by_itself():
    done = wb.solve(MuSynthesis(weighted(1.0, 1e-6), integral=True, family=PI()))
    assert done.certificate.holds
    assert done.answer.lti.nstates == 1


def test_misuse_is_named():
    with pytest.raises(InputError, match="integral must be a bool"):
        MuSynthesis(weighted(1.0, 0.01), integral=1)
    with pytest.raises(InputError, match="integral cannot be given"):
        MuSynthesis(weighted(1.0, 0.0), integral=True)
