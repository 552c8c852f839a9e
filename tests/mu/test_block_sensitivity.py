"""Sensitivities of the upper bound: closed forms, and that they add up."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.mu import bound_sensitivity, upper_bound
from workbench.structure import Complex, Full, Real, Structure

MIXED = Structure([Real(2), Complex(1), Full(2, 3)])


def random(seed, structure, *batch):
    rng = np.random.default_rng(seed)
    shape = (*batch, structure.columns, structure.rows)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_of_blocks_apart_only_the_largest_counts():
    found = bound_sensitivity(
        np.diag([1.0, 3.0, 2.0]), Structure([Complex(1), Full(1, 1), Real(1)])
    )
    np.testing.assert_allclose(found, [0, 1, 0], atol=1e-5)


def test_of_a_rank_one_matrix_each_counts_by_its_term():
    structure = Structure([Complex(1)] * 4)
    u, v = random(0, Structure([Full(4, 2)]))
    share = abs(u * v) / abs(u * v).sum()
    np.testing.assert_allclose(
        bound_sensitivity(np.outer(u, v.conj()), structure), share, atol=2e-5
    )


def test_of_a_loop_through_two_blocks_each_counts_half():
    M = np.array([[0, 5.0], [0.2, 0]])
    found = bound_sensitivity(M, Structure([Full(1, 1), Complex(1)]))
    np.testing.assert_allclose(found, [0.5, 0.5], atol=1e-5)


def test_predicts_the_bound_for_a_larger_block():
    M = random(1, MIXED, 8)
    found = bound_sensitivity(M, MIXED)
    step = 0.01
    for k, row in enumerate(MIXED.row_slices):
        larger = M.copy()
        larger[..., row] *= 1 + step
        grown = upper_bound(larger, MIXED).value / upper_bound(M, MIXED).value
        np.testing.assert_allclose(grown, (1 + step) ** found[:, k], atol=2 * step**2)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.floats(-100, 100))
def test_adds_up_to_one_and_is_never_negative(seed, decades):
    found = bound_sensitivity(10**decades * random(seed, MIXED), MIXED)
    assert found.sum() == pytest.approx(1, abs=2e-4)
    assert found.min() > -1e-4


def test_adds_up_to_one_where_a_kink_is_near():
    assert bound_sensitivity(random(429, MIXED), MIXED).sum() == pytest.approx(1, abs=2e-4)


def test_of_nothing_and_of_one_block():
    assert (bound_sensitivity(np.zeros((2, 5, 5)), Structure([Full(5, 5)])) == 0).all()
    assert bound_sensitivity(random(3, MIXED, 2, 3), MIXED).shape == (2, 3, 3)
    found = bound_sensitivity(random(3, Structure([Full(2, 2)])), Structure([Full(2, 2)]))
    assert found == pytest.approx(1, abs=1e-6)


def test_bad_input_is_refused():
    with pytest.raises(InputError, match="shape"):
        bound_sensitivity(np.eye(2), MIXED)
    with pytest.raises(InputError, match="not finite"):
        bound_sensitivity(np.full((6, 5), np.inf), MIXED)
