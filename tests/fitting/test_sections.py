"""PolynomialSections: values, and first and second derivatives of their logarithms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.fitting.sections import PolynomialSections

OMEGA = np.geomspace(0.01, 100.0, 30)


def log_of(logs):
    c = np.exp(logs)
    return np.log(c[0] + c[1] * 1j * OMEGA - c[2] * OMEGA**2)


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_logarithms_and_their_derivatives(logs):
    logs, step = np.array(logs), 1e-5
    found, log = PolynomialSections.at(OMEGA, *np.exp(logs)), log_of(logs)
    np.testing.assert_allclose(found.values, np.exp(log), rtol=1e-9)
    np.testing.assert_allclose(found.log_magnitude, log.real, atol=1e-12)
    np.testing.assert_allclose(found.phase, log.imag, atol=1e-12)
    shares = np.array(found.magnitude_shares) + 1j * np.array(found.phase_shares)
    for along, share in zip(step * np.eye(3)[1:], shares, strict=True):
        change = (log_of(logs + along) - log_of(logs - along)) / (2 * step)
        # a difference beside a root of little damping has an error of its own
        np.testing.assert_allclose(change, share, atol=1e-8 * np.abs(shares).max() ** 3 + 1e-9)


def test_many_sections_at_once_are_each_of_them():
    rng = np.random.default_rng(0)
    c, omega = rng.uniform(1, 2, (3, 4, 2, 1)), rng.uniform(1, 2, (4, 2, 5))
    found = PolynomialSections.at(omega, *c)
    for place in np.ndindex(4, 2):
        one = PolynomialSections.at(omega[place], *c[(slice(None), *place)])
        np.testing.assert_array_equal(found.values[place], one.values)
        for every, own in zip(found.magnitude_shares, one.magnitude_shares, strict=True):
            np.testing.assert_array_equal(every[place], own)


def test_the_phase_of_positive_coefficients_rises_from_zero_to_a_half_turn():
    found = PolynomialSections.at(np.array([0.0, 1.0, 1e9]), *np.array([[1.0], [0.2], [1.0]]))
    assert found.phase == pytest.approx([0.0, np.pi / 2, np.pi], abs=1e-8)
