import numpy as np
import pytest

from workbench.geometry.exact_circle import circle_radius, exact_circle
from workbench.geometry.exact_stadium import exact_stadium, stadium_radius
from workbench.geometry.thesis import thesis_circle, thesis_stadium


def random_sets(seed, sets=300, count=12):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(sets, count)) + 1j * rng.normal(size=(sets, count))


@pytest.mark.parametrize("count", [1, 2, 3, 12, 60])
def test_circle_is_the_smallest(count):
    """In general position the procedure is right."""
    points = random_sets(1, count=count)
    center, radius = thesis_circle(points)
    np.testing.assert_allclose(radius, exact_circle(points)[1], rtol=1e-13)
    again = [circle_radius(*each) for each in zip(points, center, strict=True)]
    np.testing.assert_array_equal(again, radius)


def test_circle_of_awkward_sets():
    rng = np.random.default_rng(2)
    for points in (
        np.full(4, 1 + 1j),
        np.array([0j, 1, 1j, 1 + 1j]),
        np.exp(2j * np.pi * np.arange(12) / 12),
        1e8 + np.arange(5) + 0j,
        random_sets(3, 1, 9)[0][rng.integers(0, 9, 40)],
        1e300 * random_sets(4, 1, 9)[0],
    ):
        exact, found = exact_circle(points)[1], thesis_circle(points)[1]
        assert found == pytest.approx(exact, rel=1e-12)


def test_first_stadium_is_the_narrowest():
    points = random_sets(5)
    center, radius, half_length, angle = thesis_stadium(points)
    np.testing.assert_allclose(radius, exact_stadium(points)[1], rtol=1e-13)
    shapes = zip(points, center, half_length, angle, strict=True)
    np.testing.assert_array_equal([stadium_radius(*each) for each in shapes], radius)


@pytest.mark.parametrize("away", [0.0, 0.5, 3.0, 30.0])
def test_second_stadium_is_never_narrower_and_often_wider(away):
    points = random_sets(6)
    given = points.mean(axis=-1) + away
    center, radius, half_length, angle = thesis_stadium(points, given)
    exact = exact_stadium(points, given)[1]
    found = np.isfinite(radius)
    np.testing.assert_array_equal(center, given)
    assert np.all(radius[found] >= exact[found] * (1 - 1e-12))
    assert np.all(np.isnan(half_length) == ~found)
    assert np.all(np.isnan(angle) == ~found)
    missed = ~found | (radius > exact * (1 + 1e-9))
    assert missed.mean() > 0.1


@pytest.mark.parametrize("away", [0.0, 0.5, 3.0, 30.0])
def test_midpoints_of_all_pairs_never_miss_the_second_stadium(away):
    points = random_sets(6)
    given = points.mean(axis=-1) + away
    found = thesis_stadium(points, given, medians="pairs")
    np.testing.assert_allclose(found[1], exact_stadium(points, given)[1], rtol=1e-9)


def test_second_stadium_of_the_figure():
    """Figure 5.9, triangles with the centre outside: the side case and the midpoint case."""
    sides = np.array([0j, 4, 2 + 1j])
    found, exact = thesis_stadium(sides, 2 - 0.5j), exact_stadium(sides, 2 - 0.5j)
    assert found[3] == pytest.approx(np.angle(sides[2] - sides[0]))
    assert found[1] == pytest.approx(exact[1], rel=1e-12)
    corners, center = np.array([0j, 4, 2 + 3j]), 5 + 2j
    found, exact = thesis_stadium(corners, center), exact_stadium(corners, center)
    assert found[3] == pytest.approx(np.angle(center - 0.5 * (corners[1] + corners[2])))
    np.testing.assert_allclose(found[1:], exact[1:], rtol=1e-12)


def test_without_candidates_there_is_no_answer():
    center, radius, half_length, angle = thesis_stadium([1 + 1j] * 3)
    assert np.isnan([center, radius, half_length, angle]).all()
    center, radius, half_length, angle = thesis_stadium([1 + 1j] * 3, center=2)
    assert center == 2
    assert np.isnan([radius, half_length, angle]).all()


def test_given_angle_is_trivial():
    points = random_sets(7)
    for center in (None, 0.5j):
        for mine, exact in zip(
            thesis_stadium(points, center, 1.0), exact_stadium(points, center, 1.0), strict=True
        ):
            np.testing.assert_array_equal(mine, exact)
