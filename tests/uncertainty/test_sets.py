"""Deviations from a nominal and what is left out, against brute force."""

from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.geometry import narrowest_stadium
from workbench.uncertainty import Responses
from workbench.uncertainty.covers.sets import (
    circles_about_nominal,
    deviations,
    kept,
    stadiums_about_nominal,
)

OMEGA = 2 * np.pi * np.array([1.0, 2.0, 4.0])


def random_responses(seed, count, grid=False, frequencies=3):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(frequencies, count)) + 1j * rng.normal(size=(frequencies, count))
    if grid:
        values = np.round(2 * values)
    return Responses(omega=np.arange(1.0, frequencies + 1), values=values + 20)


def test_deviations():
    responses = random_responses(0, 4)
    nominal = np.array([20.0, 19 + 1j, 18 - 2j])
    relative = deviations(responses.points, nominal, "multiplicative", responses)
    np.testing.assert_allclose(nominal[:, None] * (1 + relative), responses.values)
    absolute = deviations(responses.points, nominal, "additive", responses)
    np.testing.assert_allclose(nominal[:, None] + absolute, responses.values)


@pytest.mark.parametrize("small", [0.0, 1e-12])
def test_a_vanishing_nominal_is_named(small):
    responses = Responses(omega=OMEGA, values=np.ones((3, 2)))
    nominal = np.array([1, small, 1], dtype=complex)
    words = 'through zero at 2 Hz: .* undefined there, ask for form="additive"'
    with pytest.raises(InputError, match=words):
        deviations(responses.points, nominal, "multiplicative", responses)
    absolute = deviations(responses.points, nominal, "additive", responses)
    np.testing.assert_allclose(absolute[1], 1)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.integers(0, 10_000), st.integers(1, 9))
def test_sets_about_the_nominal(seed, count):
    rng = np.random.default_rng(seed)
    away = rng.normal(size=(2, count)) + 1j * rng.normal(size=(2, count))
    circles = circles_about_nominal(away)
    stadiums = stadiums_about_nominal(away)
    assert np.all(circles.center == 0)
    assert np.all(stadiums.center == 0)
    np.testing.assert_allclose(circles.radius, np.abs(away).max(axis=1))
    angle = np.linspace(0, np.pi, 4001)
    for k in range(2):
        across = np.abs((away[k][:, None] * np.exp(-1j * angle)).imag).max(axis=0)
        assert stadiums.radius[k] <= across.min() * (1 + 1e-12) + 1e-14
        assert stadiums.radius[k] >= across.min() - np.abs(away[k]).max() * np.pi / 4000
        end = stadiums.half_length[k] * np.exp(1j * stadiums.angle[k])
        segment = shapely.LineString([(-end.real, -end.imag), (end.real, end.imag)])
        far = shapely.distance(segment, shapely.points(away[k].real, away[k].imag)).max()
        assert far <= stadiums.radius[k] + 1e-12
    turned = stadiums_about_nominal(away, np.array([0.3, 2.0]))
    np.testing.assert_allclose(turned.angle, [0.3, 2.0])
    assert np.all(turned.radius >= stadiums.radius * (1 - 1e-12))


# --- leaving out ----------------------------------------------------------------------------------


def radius_of(points):
    circle = shapely.MultiPoint(np.column_stack([points.real, points.imag]))
    return shapely.minimum_bounding_radius(circle)


def brute_force(points, leave_out):
    subsets = combinations(range(len(points)), len(points) - leave_out)
    return min(radius_of(points[list(subset)]) for subset in subsets)


@pytest.mark.parametrize("leave_out", [0, 1, 2, 3])
@pytest.mark.parametrize("count", [5, 6, 7])
@pytest.mark.parametrize("seed", range(4))
def test_the_best_circle_is_found(seed, count, leave_out):
    responses = random_responses(seed, count)
    rest = kept(responses, leave_out, "circle")
    for points, left in zip(responses.values, rest, strict=True):
        assert set(left) <= set(points)
        assert len(set(left)) >= count - leave_out
        assert radius_of(left) == pytest.approx(brute_force(points, leave_out), rel=1e-9)


@pytest.mark.parametrize("leave_out", [1, 2])
@pytest.mark.parametrize("copied", [0, 1, 2, 5])
def test_copies_count_each(copied, leave_out):
    """Two plants of one response are two plants: leaving out one of them changes nothing."""
    for seed in range(6):
        values = random_responses(seed, 6).values
        farthest = np.argsort(-np.abs(values - values.mean(axis=1, keepdims=True)), axis=1)
        copy = np.take_along_axis(values, farthest[:, copied][:, None], axis=1)
        values = np.hstack([copy, values])
        rest = kept(Responses(omega=OMEGA, values=values), leave_out, "circle")
        for points, left in zip(values, rest, strict=True):
            assert radius_of(left) == pytest.approx(brute_force(points, leave_out), rel=1e-9)


@pytest.mark.parametrize("leave_out", [1, 2])
def test_missing_plants_are_not_among_those_left_out(leave_out):
    responses = random_responses(11, 7, frequencies=12)
    rng = np.random.default_rng(5)
    present = np.ones(responses.values.shape, bool)
    for row in present:
        row[rng.choice(7, 2, replace=False)] = False
    values = np.where(present, responses.values, np.nan)
    rest = kept(
        Responses(omega=responses.omega, values=values, present=present), leave_out, "circle"
    )
    for points, here, left in zip(values, present, rest, strict=True):
        assert set(left) <= set(points[here])
        assert radius_of(left) == pytest.approx(brute_force(points[here], leave_out), rel=1e-9)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(0, 10_000), st.integers(5, 8), st.integers(1, 3), st.booleans())
def test_stadiums_gain(seed, count, leave_out, grid):
    responses = random_responses(seed, count, grid)
    widths = [narrowest_stadium(kept(responses, k, "stadium")).radius for k in (0, leave_out)]
    assert np.all(widths[1] <= widths[0] * (1 + 1e-9))
    rest = kept(responses, leave_out, "stadium")
    for points, left in zip(responses.values, rest, strict=True):
        missing = [p for p in points if p not in left]
        assert len(missing) <= leave_out


def test_a_stray_plant_is_left_out():
    for kind in ("circle", "stadium"):
        values = np.array([[1, 1.1, 1.2, 0.9, 5 + 5j], [1, 9 - 4j, 1.2, 0.9, 1.1]])
        rest = kept(Responses(omega=OMEGA[:2], values=values), 1, kind)
        assert 5 + 5j not in rest[0]
    assert np.abs(kept(Responses(omega=OMEGA[:2], values=values), 1, "circle") - 1).max() < 0.3


def test_equal_plants_are_taken():
    responses = Responses(omega=OMEGA, values=np.ones((3, 6)))
    for kind in ("circle", "stadium"):
        assert np.all(kept(responses, 3, kind) == 1)


@pytest.mark.parametrize(
    ("leave_out", "words"),
    [
        (5, "leave_out is 5; it may be 4 at most"),
        (-1, "leave_out must be a whole number, 0 or more, not -1"),
        (1.0, "leave_out must be a whole number, 0 or more, not 1.0"),
        ("1", "not '1'"),
        (True, "not True"),
        (4, "leaving out 4 of the 5 plants at 0.159155 Hz leaves no spread"),
    ],
)
def test_refused(leave_out, words):
    with pytest.raises(InputError, match=words):
        kept(random_responses(0, 5), leave_out, "circle")


def test_too_few_at_one_frequency():
    present = np.ones((3, 6), bool)
    present[1, :3] = False
    responses = Responses(omega=OMEGA, values=np.ones((3, 6)), present=present)
    assert kept(responses, 1, "circle").shape == (3, 6)
    with pytest.raises(InputError, match="leaving out 2 of the 3 plants at 2 Hz"):
        kept(responses, 2, "circle")
