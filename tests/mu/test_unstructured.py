"""Mu of one full block, or of one complex number, is the largest singular value."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.mu import h_infinity_norm, lower_bound, upper_bound
from workbench.mu.lower import methods
from workbench.mu.upper import multipliers
from workbench.structure import Complex, Full, Real, Structure


@given(
    rows=st.integers(1, 5),
    columns=st.integers(1, 5),
    spread=st.sampled_from([0.0, 3.0, 8.0]),
    size=st.sampled_from([1e-150, 1.0, 1e150]),
    seed=st.integers(0, 2**31),
)
def test_both_bounds_are_the_largest_singular_value(rows, columns, spread, size, seed):
    rng = np.random.default_rng(seed)
    grades = [10.0 ** rng.uniform(-spread, 0.0, n) for n in (columns, rows)]
    M = rng.standard_normal((columns, rows)) + 1j * rng.standard_normal((columns, rows))
    M = size * grades[0][:, None] * M * grades[1]
    structure = Structure([Full(rows, columns)])
    largest = size * np.linalg.norm(M / size, 2)
    upper, lower = upper_bound(M, structure), lower_bound(M, structure)
    assert largest * (1 - 1e-12) <= upper.value <= largest * (1 + 1e-8)
    assert largest * (1 - 1e-8) <= lower.value <= largest * (1 + 1e-12)


def test_a_matrix_of_zeros_has_the_bound_zero():
    assert upper_bound(np.zeros((3, 2)), Structure([Full(2, 3)])).value == 0.0


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ([Full(2, 3)], True),
        ([Full(1, 1)], True),
        ([Complex(1)], True),
        ([Complex(2)], False),
        ([Real(1)], False),
        ([Full(2, 3), Complex(1)], False),
    ],
)
def test_which_structures_have_one_full_block(blocks, expected):
    assert Structure(blocks).unstructured is expected


def test_a_norm_needs_no_search(monkeypatch):
    """The compiled searches would take the longest part of a user's first minute."""

    def fail(*_):
        raise AssertionError("searched")

    monkeypatch.setattr(methods, "search_batch", fail)
    monkeypatch.setattr(multipliers.LANES, "taken", fail)
    norm = h_infinity_norm(control.tf([1.0], [1.0, 0.2, 1.0]))
    assert norm.holds
    assert norm.lower <= 5 / 0.99**0.5 <= norm.upper
