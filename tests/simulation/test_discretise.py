"""Exact discretisation against SciPy, python-control on a fine grid, and quadrature."""

import control
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import cont2discrete

from workbench.errors import InputError
from workbench.systems import bilinear_continuous
from workbench.systems.sampling import (
    held_input_matrices,
    lowpass_weights,
    respond,
    sampled_model,
)

PERIOD = 1e-3


def plant():
    """Two inputs, two outputs, a lightly damped mode, a slow pole and a feedthrough."""
    a = [[0.0, 1.0, 0.0], [-4e4, -20.0, 1.0], [0.0, 0.0, -5.0]]
    return control.ss(a, [[0.0, 1.0], [3.0, 0.0], [1.0, 2.0]], np.eye(3)[:2], [[0, 0.1], [0, 0]])


def test_hold_is_the_zero_order_hold():
    system = plant()
    phi, gamma = held_input_matrices(system.A, system.B, PERIOD)
    expected = cont2discrete((system.A, system.B, system.C, system.D), PERIOD)
    np.testing.assert_allclose(phi, expected[0], rtol=1e-12)
    np.testing.assert_allclose(gamma, expected[1], rtol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.35, 1.0, 1.6, 2.0])
def test_delayed_hold_against_a_fine_grid(delay):
    system, fine, samples = plant(), 20, 40
    u = np.random.default_rng(1).standard_normal((samples, 2))
    late = np.zeros((samples * fine, 2))
    shift = round(delay * fine)
    late[shift:] = np.repeat(u, fine, axis=0)[: len(late) - shift]
    # Staircase inputs on a grid that holds every edge: the hold of the fine grid is exact.
    fine_system = control.sample_system(system, PERIOD / fine, "zoh")
    expected = control.forced_response(fine_system, inputs=late.T).outputs[:, ::fine].T
    model = sampled_model(system, PERIOD, delay_samples=delay)
    assert model.dt == PERIOD
    np.testing.assert_allclose(respond(model, u), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("delay", [0.0, 0.25, 1.75])
def test_delayed_hold_has_the_delay_in_its_response(delay):
    omega = 2 * np.pi * np.array([1.0, 10.0])
    s = 1j * omega
    filtered = control.ss(-300.0, 300.0, 1.0, 0.0)
    held = (1 - np.exp(-s * PERIOD)) / (s * PERIOD)
    expected = filtered(s) * held * np.exp(-s * delay * PERIOD)
    z = np.exp(s * PERIOD)
    np.testing.assert_allclose(
        sampled_model(filtered, PERIOD, delay_samples=delay)(z), expected, rtol=3e-3
    )


def test_lowpass_is_exact_for_a_parabola():
    corner, duration, start = 700.0, 2e-3, 0.3
    polynomial = np.polynomial.Polynomial([1.0, -2e3, 5e5])
    weights = lowpass_weights(corner, duration)
    nodes = polynomial(np.array([0.0, 0.5, 1.0]) * duration)
    memory = np.exp(-corner * duration)
    grown = quad(lambda t: corner * np.exp(corner * (t - duration)) * polynomial(t), 0, duration)
    assert weights @ [start, *nodes] == pytest.approx(memory * start + grown[0], rel=1e-12)


@pytest.mark.parametrize("delay", [-0.1, np.nan, np.inf])
def test_delays_that_are_none(delay):
    with pytest.raises(InputError, match="finite number of samples"):
        sampled_model(plant(), PERIOD, delay_samples=delay)


def test_inputs_of_another_shape():
    with pytest.raises(InputError, match=r"\(N, 2\)"):
        respond(sampled_model(plant(), PERIOD), np.zeros(5))


def test_continued_has_the_response_of_the_discrete_system():
    rng = np.random.default_rng(3)
    A = 0.9 * np.linalg.qr(rng.standard_normal((4, 4)))[0]
    B, C = rng.standard_normal((4, 2)), rng.standard_normal((3, 4))
    system = control.ss(A, B, C, rng.standard_normal((3, 2)), 1e-3)
    omega = np.array([1.0, 50.0, 700.0, 3000.0])
    found = bilinear_continuous(system)(2e3j * np.tan(omega * 5e-4))
    np.testing.assert_allclose(found, system(np.exp(1j * omega * 1e-3)), rtol=1e-9)
    with pytest.raises(InputError, match="pole at z = -1"):
        bilinear_continuous(control.ss(-1.0, 1.0, 1.0, 0.0, 1e-3))
    with pytest.raises(InputError, match="is continuous"):
        bilinear_continuous(control.ss(-1.0, 1.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sampled_model(plant().sample(PERIOD), PERIOD), r"sampled already \(dt = 0.001\)"),
        (lambda: sampled_model("G", PERIOD), "system must be a StateSpace"),
        (lambda: sampled_model(plant(), -PERIOD), "dt is -0.001"),
        (lambda: sampled_model(control.tf([1, 0, 0], [1, 1]), PERIOD), "no realisation"),
        (lambda: bilinear_continuous(plant()), "the system is continuous"),
        (lambda: bilinear_continuous(None), "system must be a StateSpace"),
        (lambda: respond(plant(), np.zeros((3, 2))), "the system is continuous"),
        (lambda: respond("G", np.zeros((3, 2))), "system must be a StateSpace"),
    ],
)
def test_what_cannot_be_sampled_is_refused(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_a_transfer_function_is_sampled_too():
    lag = control.tf([3.0], [1.0, 5.0])
    held, exact = sampled_model(lag, 0.1), cont2discrete(([3.0], [1.0, 5.0]), 0.1)
    np.testing.assert_allclose(held.poles(), np.roots(exact[1]))
    step = np.ones((4, 1))
    discrete = control.tf(exact[0].ravel(), exact[1], 0.1)
    np.testing.assert_allclose(respond(held, step), respond(discrete, step), atol=1e-14)
    assert np.isclose(bilinear_continuous(discrete)(0.0), 0.6)
