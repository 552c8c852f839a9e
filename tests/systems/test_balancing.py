"""Balancing: entries of similar sizes, by powers of two, whatever the units were."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from workbench.systems.balancing import balanced, balancing

EXPONENTS = arrays(float, 4, elements=st.integers(-40, 40).map(float))


@given(EXPONENTS)
def test_units_of_the_states_make_no_difference(exponents):
    rng = np.random.default_rng(0)
    M = rng.standard_normal((4, 4)) + 3 * np.eye(4)
    units = np.exp2(exponents)
    scaled = M * units[:, None] / units
    rows, columns = balancing(scaled, 4)
    again = rows[:, None] * scaled * columns
    np.testing.assert_array_equal(rows * columns, 1.0)
    assert abs(again).max() < 64 * abs(M).max()
    np.testing.assert_array_equal(np.log2(rows) % 1.0, 0.0)


@pytest.mark.parametrize("size", [1e-250, 1e-160, 1e160, 1e250])
def test_entries_whose_squares_overflow_or_vanish(size):
    M = np.array([[size, 0.0], [3.0, size]])
    rows, columns = balancing(M, 1)
    shown = rows[:, None] * M * columns
    assert np.isfinite(rows).all() and np.isfinite(columns).all()
    assert 0.25 < abs(shown[1]).max() < 4.0


def test_a_balanced_realisation_has_the_same_markov_parameters():
    rng = np.random.default_rng(1)
    A, B, C = rng.standard_normal((3, 3)), rng.standard_normal((3, 1)), rng.standard_normal((1, 3))
    units = np.array([1e-6, 1.0, 1e8])
    a, b, c = balanced(A * units[:, None] / units, B * units[:, None], C / units)
    for k in range(4):
        np.testing.assert_allclose(
            c @ np.linalg.matrix_power(a, k) @ b, C @ np.linalg.matrix_power(A, k) @ B, rtol=1e-9
        )
    assert abs(a).max() < 1e3
