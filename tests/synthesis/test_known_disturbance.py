"""Bounds by known disturbances: below every norm, close to the least one."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_lyapunov

from workbench.certify.norms import certified_norm
from workbench.errors import InputError
from workbench.synthesis import MixedSensitivity, hinf, known_disturbance_bound
from workbench.synthesis.h_infinity.known_disturbance import exponentials
from workbench.uncertainty import GeneralisedPlant

RATES = np.geomspace(1e-2, 1e2, 24)


def mixed(pole=1.0, bandwidth=1.0, cost=0.5):
    G = control.tf(1, [1, pole])
    return MixedSensitivity(G, W_S=control.tf(bandwidth, [1, 0.1]), W_KS=cost)


def test_exponentials_are_orthonormal():
    A, C = exponentials(RATES)
    np.testing.assert_allclose(solve_continuous_lyapunov(A.T, -C.T @ C), np.eye(24), atol=1e-10)
    np.testing.assert_allclose(np.sort(-np.linalg.eigvals(A).real), RATES, rtol=1e-9)


@pytest.mark.cases(0)
@settings(max_examples=15, deadline=None)
@given(st.floats(0.2, 5), st.floats(0.2, 5), st.floats(0.1, 2))
def test_close_below_the_least_norm_where_the_measurement_tells_the_disturbance(p, w, cost):
    program = mixed(p, w, cost)
    bound = known_disturbance_bound(program.plant, RATES).lower
    least = hinf(program.plant).norm
    assert 0.99 * least < bound < least


@pytest.mark.cases(0)
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_below_the_norm_of_any_controller_of_any_plant(seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4)) - 3 * np.eye(4)  # stable or not
    D = np.block(
        [[rng.normal(size=(3, 3)), np.vstack([0.0, rng.normal(size=(2, 1))])], [1.0, 0.5, 1, 0]]
    )
    system = control.ss(A, rng.normal(size=(4, 4)), rng.normal(size=(4, 4)), D)
    plant = GeneralisedPlant(system, None, 1, 1)
    found = known_disturbance_bound(plant, RATES)
    bound, disturbance = found.lower, found.disturbance
    assert disturbance.shape == (3, 24)
    assert np.linalg.norm(disturbance) == pytest.approx(1)
    assert bound < hinf(plant).norm


@pytest.mark.cases(0)
def test_it_is_the_least_energy_over_all_controls():
    """Against least squares over controls made of many exponentials, in the frequency domain."""
    program = mixed()
    found = known_disturbance_bound(program.plant, RATES)
    bound, (signal,) = found.lower, found.disturbance
    omega = np.geomspace(1e-5, 1e5, 4000)

    def signals(rates):
        A, C = exponentials(rates)
        s = 1j * omega[:, None, None]
        return (C @ np.linalg.inv(s * np.eye(len(A)) - A))[:, 0]

    w, controls = signals(RATES) @ signal, signals(np.geomspace(1e-3, 1e3, 40))
    s = 1j * omega
    W, G = 1 / (s + 0.1), 1 / (s + 1)
    weight = np.sqrt(np.gradient(omega) / np.pi)
    fixed = np.concatenate([W * w, 0 * w])
    moved = np.concatenate([(-W * G)[:, None] * controls, 0.5 * controls])
    rows = np.concatenate([weight, weight])
    real = [
        np.concatenate([part.real, part.imag]) for part in (rows * fixed, rows[:, None] * moved)
    ]
    left = real[0] - real[1] @ np.linalg.lstsq(real[1], real[0])[0]
    assert np.linalg.norm(left) == pytest.approx(bound, rel=1e-3)


def test_more_signals_never_lower_it():
    plant = mixed().plant
    bounds = [known_disturbance_bound(plant, RATES[::step]).lower for step in (8, 4, 2, 1)]
    assert (np.diff(bounds) > -1e-9).all()


def test_it_bounds_controllers_that_are_not_optimal():
    program = mixed()
    bound = known_disturbance_bound(program.plant, RATES).lower
    for gain in (0.1, 1.0, 10.0):
        assert certified_norm(program.plant.close(control.ss([], [], [], gain))) > bound


def test_wrong_input_is_named():
    plant = mixed().plant
    for rates in ([], [1.0, 1.0], [-1.0], [np.nan]):
        with pytest.raises(InputError, match="rates"):
            known_disturbance_bound(plant, rates)
    sampled = GeneralisedPlant(control.sample_system(plant.system, 0.1, "bilinear"), None, 1, 1)
    with pytest.raises(InputError, match="continuous"):
        known_disturbance_bound(sampled, RATES)
    free = control.ss(plant.system.A, plant.system.B, plant.system.C, 0 * plant.system.D)
    with pytest.raises(InputError, match="D12"):
        known_disturbance_bound(GeneralisedPlant(free, None, 1, 1), RATES)


@pytest.mark.parametrize("seed", range(4))
def test_the_least_energy_in_samples_is_that_of_the_disturbance(seed):
    """Dynamic programming agrees, and refutes a bound that is too large; unstable plants too."""
    rng = np.random.default_rng(seed)
    parts = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=(4, 3))
    D = np.block([[rng.normal(size=(3, 2)), np.eye(3, 1)], [np.eye(1, 2), np.zeros((1, 1))]])
    plant = GeneralisedPlant(control.ss(*parts, D), None, 1, 1)
    found = known_disturbance_bound(plant, [0.1, 1.0, 7.0])
    assert found.holds, found.certificate.failures
    (check,) = found._checked_by[0].second_opinion(found)
    assert -1e-5 < check.value < 1e-6
    (check,) = found._checked_by[0].second_opinion(replace(found, lower=1.01 * found.lower))
    assert not check.holds
