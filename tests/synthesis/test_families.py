"""Families of controllers: responses, slopes, and which systems are members."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import Modal

OMEGA = np.geomspace(0.01, 100.0, 40)


def random(order, outputs, inputs, seed=0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(order, order)) - 0.5 * np.eye(order)
    B, C = rng.normal(size=(order, inputs)), rng.normal(size=(outputs, order))
    return control.ss(A, B, C, rng.normal(size=(outputs, inputs)))


def at(K, omega):
    return np.moveaxis(K(1j * omega, squeeze=False), -1, 0)


@pytest.mark.parametrize("size", [(5, 1, 1), (6, 2, 2), (3, 2, 1), (1, 1, 3), (0, 1, 2)])
def test_a_controller_is_a_member_of_its_own_family(size):
    K = random(*size)
    family, x = Modal.of(K)
    np.testing.assert_allclose(family.response(x, OMEGA)[0], at(K, OMEGA), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(at(family.system(x), OMEGA), at(K, OMEGA), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(family.parameters(K), x)


@pytest.mark.parametrize("size", [(5, 1, 1), (4, 2, 2), (3, 2, 1)])
def test_slopes_are_those_of_the_response(size):
    family, x = Modal.of(random(*size, seed=3))
    value, slopes = family.response(x, OMEGA)
    for k in range(x.size):
        y = x.copy()
        step = 1e-6 * max(abs(x[k]), 1.0)
        y[k] += step
        change = (family.response(y, OMEGA)[0] - value) / step
        np.testing.assert_allclose(change, slopes[:, k], atol=1e-3 * np.abs(slopes).max())


def test_members_may_have_other_poles_and_keep_real_coefficients():
    family, x = Modal.of(random(5, 1, 1))
    K = family.system(x + 0.1)
    assert np.isrealobj(K.A)
    assert K.nstates == 5


def test_what_has_no_block_is_refused():
    twice = control.ss(-np.eye(2), np.ones((2, 1)), np.ones((1, 2)), 0.0)
    with pytest.raises(InputError, match="equal real poles"):
        Modal.of(twice)
    with pytest.raises(InputError, match="defective"):
        Modal.of(control.ss([[-1.0, 1.0], [0.0, -1.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0))
    family, _ = Modal.of(random(5, 1, 1))
    with pytest.raises(InputError, match="corners"):
        family.parameters(random(4, 1, 1, seed=1))


def test_parameters_of_modes_far_apart_keep_the_digits_of_a_response():
    """Each real mode has its own size: together they would cancel, and again in every round."""
    poles, residues = np.array([-7e-4, -6e4, -9e4]), np.array([3.0, -1e5, 4e4])
    B, C = np.sqrt(abs(residues)) * [1e4, 1e-4, 1.0], np.sign(residues) * np.sqrt(abs(residues))
    K = control.ss(np.diag(poles), B[:, None], [C / [1e4, 1e-4, 1.0]], 0.5)
    omega = np.geomspace(1e-4, 1e6, 60)
    exact = 0.5 + (residues / (1j * omega[:, None] - poles)).sum(axis=1)
    for _ in range(4):
        family, x = Modal.of(K)
        K = family.system(x)
        np.testing.assert_allclose(K(1j * omega), exact, rtol=1e-9)
    assert max(abs(K.B).max(), abs(K.C).max()) < 1e6
