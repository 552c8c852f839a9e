"""The two masses: the generalised plant against the element equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from workbench.plants.mass_spring.equations import characteristic_roots, determinant
from workbench.plants.mass_spring.plant import (
    B1,
    B2,
    K2,
    M1,
    M2,
    simple_controller,
    two_mass_plant,
    weights,
)

from workbench.structure import Complex, Full, Real, Structure


def test_sizes_and_structure():
    plant = two_mass_plant()
    assert plant.structure == Structure((Complex(1, name="dynamics"), Real(1, name="k1")))
    assert (plant.exogenous, plant.performance) == (2, 2)
    assert (plant.controls, plant.measurements) == (1, 1)
    assert plant.structure.with_performance(2, 2).blocks[-1] == Full(2, 2, name="performance")
    assert plant.system.nstates == 4 + 4  # the masses, and four weights with a pole


@pytest.mark.parametrize("delta", [-1.0, 0.0, 1.0])
def test_the_spring_goes_from_1_2_to_2_8(delta):
    """Forces to z2 with the perturbation closed, against the equations of motion."""
    omega = np.array([0.1, 0.55, 1.8, 30.0])
    plant, k1 = two_mass_plant(), 2.0 + 0.8 * delta
    P = plant.response(omega)
    Delta = np.diag([0.3j, delta])
    closed = P[:, 2:, 2:] + P[:, 2:, :2] @ Delta @ np.linalg.solve(
        np.eye(2) - P[:, :2, :2] @ Delta, P[:, :2, 2:]
    )
    W = weights()
    for k, s in enumerate(1j * omega):
        link, wall = k1 + B1 * s, K2 + B2 * s
        motion = np.array([[M1 * s**2 + link, -link], [-link, M2 * s**2 + link + wall]])
        from_f1, from_f2 = np.linalg.inv(motion)[1]
        z2 = [W["W_d"](s) * from_f2, 0.0, (1 + 0.3j * W["W_m"](s)) * from_f1]
        expected = np.array([W["W_p"](s) * np.array(z2), [0, 0, W["W_u"](s)], z2])
        expected[2, 1] = 0.001
        np.testing.assert_allclose(closed[k], expected, rtol=1e-10, atol=1e-14)


def test_the_unmodelled_dynamics_cover_a_delay():
    omega = np.geomspace(0.01, 1000, 4000)
    bound = abs(weights()["W_m"](1j * omega))
    for delay in (0.01, 0.03, 0.058):
        assert (abs(np.exp(-1j * omega * delay) - 1) <= bound).all()
    ratio = abs(np.exp(-1j * omega * 0.06) - 1) / bound
    assert 1.01 < ratio.max() < 1.015
    assert omega[ratio > 1] == pytest.approx(37, abs=9.5)


@given(
    omega=st.floats(0.01, 100.0),
    parts=st.lists(st.floats(-2.0, 2.0), min_size=11, max_size=11),
)
@pytest.mark.slow
def test_the_determinant_is_that_of_n(omega, parts):
    plant = two_mass_plant()
    N = plant.close(simple_controller())(1j * omega)
    Delta = np.zeros((4, 4), complex)
    Delta[0, 0], Delta[1, 1] = parts[0] + 1j * parts[1], parts[2]
    Delta[2:, 2:] = np.reshape(np.array(parts[3:7]) + 1j * np.array(parts[7:]), (2, 2))
    expected = np.linalg.det(np.eye(4) - N @ Delta)
    scale = 1 + np.linalg.norm(N @ Delta) ** 2
    assert abs(determinant(omega, Delta) - expected) <= 1e-9 * scale


def test_the_closed_loop_has_the_characteristic_roots():
    poles = two_mass_plant().close(simple_controller()).poles()
    for root in characteristic_roots(0.0):
        assert abs(poles - root).min() <= 1e-9
