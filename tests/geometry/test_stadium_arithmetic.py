"""Products of stadiums with numbers, and distances of points from them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.geometry import (
    Stadium,
    multiplied_sets,
    sets_around_nominal,
    signed_distance,
    signed_distance_bounds,
)

number = st.floats(-10.0, 10.0)
size = st.floats(0.01, 10.0)
CRITICAL = -1.0 + 0.0j


def one(center, radius, length, angle):
    return Stadium(*(np.array([value]) for value in (center, radius, length, angle)))


def test_distances_by_hand():
    upright = one(0.0 + 0j, 0.5, 1.0, np.pi / 2)
    points = {-1 + 0j: 0.5, -1 + 1j: 0.5, 2j: 0.5, 0.3 + 0.2j: -0.2, 3 + 5j: 4.5}
    for point, expected in points.items():
        assert signed_distance(point, upright)[0] == pytest.approx(expected, abs=1e-12)


@given(number, number, size, size, st.floats(0.0, 3.14), number, number)
def test_a_product_with_a_number_keeps_what_is_inside(x, y, radius, length, angle, a, b):
    sets, factor, point = one(x + 1j * y, radius, length, angle), a + 1j * b, CRITICAL
    before = signed_distance(point, sets)
    after = signed_distance(point * factor, multiplied_sets(np.array([factor]), sets))
    np.testing.assert_allclose(after, abs(factor) * before, atol=1e-11)


@given(number, number, size, size, st.floats(0.0, 3.14))
def test_the_bounds_hold_the_distance(x, y, radius, length, angle):
    sets = one(x + 1j * y, radius, length, angle)
    low, high = signed_distance_bounds(CRITICAL, sets)
    found = signed_distance(CRITICAL, sets)
    assert low <= found + 1e-11
    assert found <= high + 1e-11


def test_sets_around_a_nominal_hold_what_its_deviations_make():
    relative = one(0.1 + 0.2j, 0.3, 0.6, 1.0)
    nominal = np.array([2.0 - 1.0j])
    sets = sets_around_nominal(nominal, relative)
    rng = np.random.default_rng(0)
    delta = rng.uniform(-1.5, 1.5, 500) + 1j * rng.uniform(-1.5, 1.5, 500)
    inside = [signed_distance(each, relative)[0] <= 0 for each in delta]
    placed = [signed_distance(nominal[0] * (1 + each), sets)[0] <= 0 for each in delta]
    assert inside == placed
    assert 10 < sum(inside) < 490
