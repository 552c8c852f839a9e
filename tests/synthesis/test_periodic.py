"""The longest unstable dwell, against a search of every pair of stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples

from workbench.synthesis.switching.modes import Mode
from workbench.synthesis.switching.periodic import longest_unstable


def every_pair(A, B, longest, horizon=400):
    """The longest stay n <= horizon for which some A^n B^m grows, by all products."""
    best, first = 0, np.eye(len(A))
    seconds = [np.linalg.matrix_power(B, m) for m in range(1, longest + 1)]
    for n in range(1, horizon + 1):
        first = A @ first
        if np.abs(np.linalg.eigvals(first @ np.array(seconds))).max() > 1 + 1e-9:
            best = n
    return best


@examples(20, 60)
@given(st.integers(0, 10**6))
def test_is_that_of_a_search_of_every_pair(seed):
    rng = np.random.default_rng(seed)
    n, longest = int(rng.integers(1, 5)), int(rng.integers(1, 20))
    A, B = rng.standard_normal((2, n, n))
    A *= rng.uniform(0.3, 0.95) / np.abs(np.linalg.eigvals(A)).max()
    B *= rng.uniform(0.5, 1.3) / np.abs(np.linalg.eigvals(B)).max()
    found, stay = longest_unstable(
        Mode("in", A, shortest_samples=None),
        Mode("out", B, shortest_samples=1, longest_samples=longest),
        400,
    )
    assert found == every_pair(A, B, longest)
    if found:
        product = np.linalg.matrix_power(A, found) @ np.linalg.matrix_power(B, stay)
        assert np.abs(np.linalg.eigvals(product)).max() > 1


def test_a_stay_that_a_selection_would_pass_over():
    # A turns by 90 degrees in 101 samples; only then B finds again what it has stretched.
    angle = np.pi / 202
    A = 0.99999 * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    B = np.array([[0.0, 1.002], [0.0, 0.0]])
    found, stay = longest_unstable(
        Mode("in", A, shortest_samples=None),
        Mode("out", B, shortest_samples=1, longest_samples=1),
        150,
    )
    assert (found, stay) == (every_pair(A, B, 1, 150), 1)
    assert 101 <= found <= 104


@pytest.mark.parametrize("scale", [1e-8, 1e8])
def test_units_do_not_matter(scale):
    rng = np.random.default_rng(3)
    A, B = rng.standard_normal((2, 3, 3))
    A, B = 0.8 * A / np.abs(np.linalg.eigvals(A)).max(), 1.1 * B
    T = np.diag([1.0, scale, 1.0])
    changed = [T @ each @ np.linalg.inv(T) for each in (A, B)]
    other = longest_unstable(
        Mode("in", changed[0], shortest_samples=None),
        Mode("out", changed[1], shortest_samples=1, longest_samples=9),
        400,
    )
    assert other == longest_unstable(
        Mode("in", A, shortest_samples=None),
        Mode("out", B, shortest_samples=1, longest_samples=9),
        400,
    )
    assert other[0] > 0
