"""The least mu of any controller, against searches over all T, and what it bounds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.mu import upper_bound
from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis import LoopWeights, largest_least_mu, least_mu

size = st.floats(-2, 2).map(lambda x: round(10**x, 4))
angle = st.floats(-3.2, 3.2).map(lambda x: round(x, 3))


def weights(count, seed):
    rng = np.random.default_rng(seed)
    sizes = 10 ** rng.uniform(-1.5, 1.5, (4, count))
    return LoopWeights(*sizes[:3], sizes[3] * np.exp(2j * np.pi * rng.uniform(size=count)))


@given(size, size, size, size, angle)
def test_no_T_of_a_search_beats_it_and_the_best_comes_close(W_p, W_u, W_c, W_r, turn):
    given_weights = LoopWeights(W_p, W_u, W_c, W_r * np.exp(1j * turn))
    found = least_mu(given_weights)
    moduli, angles = np.linspace(0, 1.2, 121)[:, None], np.linspace(-np.pi, np.pi, 181)
    T = (moduli * np.exp(1j * angles)).reshape(-1, 1)
    searched = given_weights.mu(T).min()
    assert found.lower[0] <= searched * (1 + 1e-12)
    assert searched <= found.upper[0] * 1.1  # what the search's steps leave
    assert found.lower[0] <= found.upper[0] <= found.lower[0] / (1 - 1e-3) * (1 + 1e-12)
    assert given_weights.mu(found.T)[0] == pytest.approx(found.upper[0], rel=1e-12)


def test_a_tighter_tolerance_narrows_the_bounds_around_the_same_number():
    many = weights(100, 1)
    wide, narrow = least_mu(many, tolerance=1e-2), least_mu(many, tolerance=1e-4)
    assert (narrow.lower >= wide.lower * (1 - 1e-12)).all()
    assert (narrow.upper <= wide.upper * (1 + 1e-12)).all()
    assert (narrow.upper / narrow.lower - 1).max() < 1.1e-4


def test_circles_without_control_weight_leave_the_smaller_of_both_weights():
    many = replace(weights(100, 2), control=np.zeros(100), real=np.zeros(100))
    expected = np.minimum(many.performance, many.circular)
    np.testing.assert_allclose(least_mu(many).upper, expected, rtol=1e-9)
    np.testing.assert_allclose(least_mu(many).lower, expected, rtol=2e-3)


def test_the_nominal_plant_leaves_what_its_two_weights_do():
    many = replace(weights(100, 3), circular=np.zeros(100), real=np.zeros(100))
    expected = many.performance * many.control / np.hypot(many.performance, many.control)
    np.testing.assert_allclose(least_mu(many).upper, expected, rtol=1e-9)


def test_a_real_weight_costs_at_most_what_the_same_complex_one_does():
    many = weights(100, 4)
    circles = replace(many, circular=many.circular + np.abs(many.real), real=np.zeros(100))
    assert (least_mu(many).lower <= least_mu(circles).upper).all()
    without = replace(many, real=np.zeros(100))
    assert (least_mu(many).upper >= least_mu(without).lower).all()


def test_mu_of_T_is_that_of_the_matrix():
    many = weights(40, 5)
    rng = np.random.default_rng(6)
    T = rng.uniform(-1, 1.5, 40) + 1j * rng.uniform(-1, 1, 40)
    left = [many.real * T, many.circular * T, many.performance * (1 - T), many.control * T]
    right = [np.ones(40), np.ones(40), np.ones(40)]
    M = np.array(left).T[:, :, None] * np.array(right).T[:, None, :]
    structure = Structure([Real(1), Complex(1), Full(1, 2)])
    np.testing.assert_allclose(many.mu(T), upper_bound(M, structure).value, rtol=1e-5)


def test_the_radius_that_mu_leaves_room_for_makes_mu_the_level():
    rng = np.random.default_rng(3)
    T = rng.normal(size=50) + 1j * rng.normal(size=50)
    end = 0.4 * (rng.normal(size=50) + 1j * rng.normal(size=50))
    loop = LoopWeights(*rng.uniform(0.1, 0.5, (3, 50)), end)
    level = 6.0
    radius = loop.largest_circular(T, level)
    room = radius > 0
    assert room.sum() > 10
    there = LoopWeights(loop.performance, loop.control, np.maximum(radius, 0.0), end)
    np.testing.assert_allclose(there.mu(T)[room], level, rtol=1e-9)


def test_the_largest_is_found_between_frequencies():
    def resonant(omega):
        peak = 2 / np.sqrt(1 + ((omega - 33.3) / 0.5) ** 2)
        return LoopWeights(np.full(omega.shape, 9.0), 0.0, peak, 0.0)

    found = largest_least_mu(resonant, np.geomspace(1, 1e3, 100))
    assert found.omega == pytest.approx(33.3, abs=0.02)
    assert found.lower == pytest.approx(2.0, rel=3e-3)
    assert found.lower <= 2.0


@pytest.mark.parametrize(
    ("name", "value"),
    [("performance", 0.0), ("control", -1.0), ("circular", np.nan), ("real", np.inf)],
)
def test_weights_that_are_none_are_refused(name, value):
    parts = {"performance": 1.0, "control": 1.0, "circular": 1.0, "real": 1.0, name: value}
    with pytest.raises(InputError, match=name):
        LoopWeights(**parts)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -1e-3])
def test_a_tolerance_that_is_none_is_refused(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        least_mu(weights(1, 7), tolerance=tolerance)
