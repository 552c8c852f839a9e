"""Minimisers of functions with kinks, on functions whose minima are known."""

import math

import numpy as np
import pytest

from workbench.synthesis.mu.structured.nonsmooth.bfgs import bfgs_end, sampled_end, stationarity
from workbench.synthesis.mu.structured.nonsmooth.evolution import evolution_end
from workbench.synthesis.mu.structured.nonsmooth.hull import least_in_hull
from workbench.synthesis.mu.structured.nonsmooth.smoothed import ipopt_minimum


def absolute_rosenbrock(y):
    """8 |a^2 - b| + (1 - a)^2: a kink along a parabola, and its minimum 0 at (1, 1)."""
    a, b = y
    side = np.sign(a**2 - b)
    slope = np.array([16 * side * a - 2 * (1 - a), -8 * side])
    return 8 * abs(a**2 - b) + (1 - a) ** 2, slope


def walled(y):
    """A quadratic function, infinite left of 0, whose minimum 1 is at (1, 2)."""
    if y[0] <= 0:
        return math.inf, np.zeros(2)
    return 1 + (y[0] - 1) ** 2 + 10 * (y[1] - 2) ** 2, np.array([2 * y[0] - 2, 20 * (y[1] - 2)])


def test_the_least_element_of_a_hull():
    assert least_in_hull(np.array([[1.0, 1.0], [1.0, -1.0]])) == pytest.approx([1.0, 0.0])
    assert least_in_hull(np.array([[1.0, 2.0], [-1.0, -2.0]])) == pytest.approx([0, 0], abs=1e-12)
    assert least_in_hull(np.array([[3.0, 4.0]])) == pytest.approx([3.0, 4.0])
    assert least_in_hull(np.zeros((2, 3))).tolist() == [0.0, 0.0, 0.0]


def test_bfgs_goes_down_along_a_kink():
    y, value = bfgs_end(absolute_rosenbrock, np.array([-1.0, 1.5]), 300)
    y, value = sampled_end(absolute_rosenbrock, y, np.random.default_rng(0))
    assert value < 1e-3
    assert y == pytest.approx([1.0, 1.0], abs=0.05)


def test_a_wall_is_no_obstacle():
    y, value = bfgs_end(walled, np.array([0.01, -5.0]), 100)
    assert value == pytest.approx(1.0, abs=1e-6)
    assert y == pytest.approx([1.0, 2.0], abs=1e-3)


def test_enough_is_enough():
    _, value = bfgs_end(walled, np.array([4.0, 5.0]), 100, enough=50.0)
    assert 1.0 < value <= 50.0


def test_stationarity_tells_a_minimum_from_a_slope():
    rng = np.random.default_rng(1)
    assert stationarity(absolute_rosenbrock, np.array([1.0, 1.0]), rng) < 0.1
    assert stationarity(absolute_rosenbrock, np.array([0.0, 0.0]), rng) > 0.5


def test_evolution_needs_no_slopes():
    y, value = evolution_end(
        lambda y: absolute_rosenbrock(y)[0], np.array([-1.0, 1.5]), np.random.default_rng(3), 300
    )
    assert value < 1e-3
    assert y == pytest.approx([1.0, 1.0], abs=0.05)
    y, value = evolution_end(
        lambda y: walled(y)[0], np.array([3.0, 0.0]), np.random.default_rng(4), 300
    )
    assert y == pytest.approx([1.0, 2.0], abs=1e-2)


def test_ipopt_shortens_steps_into_a_wall():
    y = ipopt_minimum(walled, np.array([0.1, 0.0]), 100, 10.0)
    assert y == pytest.approx([1.0, 2.0], abs=1e-3)
    assert ipopt_minimum(walled, np.array([3.0, 0.0]), 100, 0.5)[0] > 2.499
