import numpy as np
import pytest

from workbench.errors import InputError
from workbench.geometry.points import (
    as_batch,
    as_points,
    canonical_angle,
    find_frame,
    point_from_frame,
    to_frame,
)


def test_complex_and_real_points():
    assert as_points([1, 2j]).dtype == np.complex128
    assert as_points([1, 2, 3]).tolist() == [1, 2, 3]
    assert as_points(np.zeros((0, 5), complex)).shape == (0, 5)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], r"shape \(0,\)"),
        (1j, r"shape \(\)"),
        (np.zeros((3, 0), complex), r"shape \(3, 0\)"),
        ([[1.0, 2.0], [3.0, 4.0]], r"points\[\.\.\., 0\] \+ 1j"),
        ([0.0, 1.0], "x, y pairs"),
        ([1j, np.nan, np.inf], "2 of 3 values .* first at index 1;"),
        ([[1j, 0], [0, complex(0, np.inf)]], r"1 of 4 .* index \(1, 1\)"),
        (["a", "b", "c"], "no numbers"),
        ([True, False, True], "no numbers"),
        ([[1j], [1, 2]], "no array of numbers"),
        (None, "no numbers"),
    ],
)
def test_refused_points(given, words):
    with pytest.raises(InputError, match=words):
        as_points(given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"center": np.nan}, "center: 1 of 1"),
        ({"center": np.zeros(4)}, "do not broadcast"),
        ({"angle": np.inf}, "angle: 1 of 1"),
        ({"angle": 1j}, "radians"),
        ({"angle": "east"}, "no numbers"),
    ],
)
def test_refused_centers_and_angles(given, words):
    with pytest.raises(InputError, match=words):
        as_batch(np.zeros((3, 5), complex), **given)


def test_given_broadcast_with_leading_axes():
    batch = as_batch(np.zeros((3, 1, 5), complex), center=np.arange(4), angle=-0.5)
    assert batch.shape == (3, 4)
    assert batch.sets.shape == (3, 5)
    assert batch.which.tolist() == [0] * 4 + [1] * 4 + [2] * 4
    np.testing.assert_allclose(batch.angle, np.pi - 0.5)


def test_canonical_angle():
    given = [0.0, -1e-20, np.pi, -np.pi, 4.0, -1.0]
    turned = canonical_angle(given)
    assert np.all((turned >= 0) & (turned < np.pi))
    np.testing.assert_allclose(np.exp(2j * turned), np.exp(2j * np.array(given)), atol=1e-14)


@pytest.mark.parametrize(
    "points",
    [
        np.array([1e8, 1e8 + 1, 1e8 + 1j]),
        np.array([-1.7e308, 1.7e308, 1.7e308j]),
        np.array([5e-324, 5e-324j, 1e-323]),
        np.array([3 + 4j]),
    ],
)
def test_frame_is_of_unit_size_and_undone_exactly(points):
    frame = find_frame(points, False, 0j)
    x, y = to_frame(points, frame)
    assert 0.25 <= max(np.abs(x).max(), np.abs(y).max()) <= 2 or points.size == 1
    assert [point_from_frame(frame, a, b) for a, b in zip(x, y, strict=True)] == points.tolist()
