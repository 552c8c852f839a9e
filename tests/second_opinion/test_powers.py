"""Growth by powers agrees with known spectral radii and tells stable from unstable loops."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.second_opinion.powers import growth


@given(radius=st.floats(0.01, 100.0), seed=st.integers(0, 50))
def test_growth_is_the_logarithm_of_the_spectral_radius(radius, seed):
    A = np.random.default_rng(seed).standard_normal((5, 5))
    A *= radius / np.abs(np.linalg.eigvals(A)).max()
    rate, rounding = growth(A, 1.0)
    assert rate == pytest.approx(math.log(radius), abs=10 * rounding + 1e-12)


@pytest.mark.parametrize("damping", [1e-1, 1e-4, 1e-8])
def test_light_damping_is_seen_on_either_side(damping):
    for sign in (-1, 1):
        A = np.array([[sign * damping, 1.0], [-1.0, sign * damping]])
        rate, rounding = growth(A, 0.0)
        assert np.sign(rate) == sign
        assert abs(rate) > rounding


def test_no_states_and_nilpotent_states_do_not_grow():
    assert growth(np.zeros((0, 0)), None)[0] == -math.inf
    assert growth(np.diag([1.0, 1.0], 1), 1.0)[0] == -math.inf


def test_units_of_states_and_of_time_do_not_matter():
    A = np.array([[-1.0, 5.0], [-5.0, -1.0]])
    scale = np.array([1.0, 1e9])
    graded = 1e6 * A * scale[:, None] / scale
    assert growth(graded, 0)[0] == pytest.approx(growth(A, 0)[0], rel=0.2)


@pytest.mark.parametrize("slowest", [-1.0, 1.0])
def test_rounding_of_powers_is_no_growth(slowest):
    """An integer similarity, exact in doubles, by which these take the stable one to grow too."""
    rng = np.random.default_rng(0)
    T = np.eye(6) + np.triu(rng.integers(-30, 30, (6, 6)), 1)
    mixed = np.eye(6) + np.tril(rng.integers(-1, 2, (6, 6)), -1)
    back, unmixed = np.round(np.linalg.inv(T)), np.round(np.linalg.inv(mixed))
    assert np.array_equal(T @ back, np.eye(6)) and np.array_equal(mixed @ unmixed, np.eye(6))
    A = T @ (mixed @ np.diag([slowest, -2.0, -3.0, -8.0, -30.0, -100.0]) @ unmixed) @ back
    rate, rounding = growth(A, 0)
    assert np.sign(rate) == slowest and abs(rate) > rounding
