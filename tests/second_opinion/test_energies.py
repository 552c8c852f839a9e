"""Least energies by dynamic programming, and graphs of plants as sequences in time."""

import control
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from workbench.second_opinion.energies import graph_distance, in_samples, least_energy


@pytest.mark.parametrize("seed", range(4))
def test_the_least_energy_is_that_of_the_riccati_equation(seed):
    """In samples of any rate, of unstable systems too."""
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(5, 4))
    D = rng.normal(size=(5, 2))
    exact = solve_continuous_are(A, B, C.T @ C, D.T @ D, s=C.T @ D)
    found = least_energy(in_samples(control.ss(A, B, C, D), 3.7))
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-9 * np.abs(exact).max())


def test_an_input_that_no_output_shows_has_no_least_energy():
    zero = np.zeros((1, 1))
    assert least_energy((0.5 * np.eye(1), np.eye(1), np.eye(1), zero)) is None


def static(gain):
    return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])


def test_graphs_of_static_gains_are_lines_at_an_angle():
    for a, b in [(1.0, 2.0), (0.0, 1.0), (-1.0, 1.0), (3.0, 3.0)]:
        angle = abs(np.arctan(a) - np.arctan(b))
        assert graph_distance(static(a), static(b)) == pytest.approx(np.sin(angle), abs=1e-12)
