from fractions import Fraction

import numpy as np
import pytest
import scipy.spatial
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.geometry.hull import convex_hull


def turn(a, b, c):
    """The exact sign-carrying cross product (b - a) x (c - a)."""
    (ax, ay), (bx, by), (cx, cy) = ((Fraction(p.real), Fraction(p.imag)) for p in (a, b, c))
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@pytest.mark.parametrize("count", [3, 10, 100, 1000, 20000])
@pytest.mark.parametrize("shape", ["normal", "uniform", "circle"])
def test_vertices_are_those_of_qhull(count, shape):
    rng = np.random.default_rng(count)
    points = {
        "normal": rng.normal(size=count) + 1j * rng.normal(size=count),
        "uniform": rng.uniform(size=count) + 1j * rng.uniform(size=count),
        "circle": np.exp(1j * rng.uniform(0, 2 * np.pi, count)),
    }[shape]
    qhull = scipy.spatial.ConvexHull(np.column_stack([points.real, points.imag]))
    hull = convex_hull(points)
    assert set(hull.tolist()) == set(points[qhull.vertices].tolist())


@given(
    st.lists(
        st.builds(complex, st.integers(-4, 4), st.integers(-4, 4)), min_size=1, max_size=30
    ).map(np.array)
)
def test_strictly_convex_and_around_all(points):
    hull = convex_hull(points)
    assert set(hull.tolist()) <= set(points.tolist())
    if hull.size > 2:
        for a, b, c in zip(hull, np.roll(hull, -1), np.roll(hull, -2), strict=True):
            assert turn(a, b, c) > 0
    for a, b in zip(hull, np.roll(hull, -1), strict=True):
        assert all(turn(a, b, p) >= 0 for p in points)


def test_nearly_collinear_points_in_exact_arithmetic():
    # box centre 0 and unit size: the frame is the identity, so the exact hull is asked for
    rng = np.random.default_rng(1)
    t = np.append(rng.uniform(-1, 1, 60), [-1, 1])
    points = t + 1j * (0.3 * t)
    hull = convex_hull(points)
    for a, b in zip(hull, np.roll(hull, -1), strict=True):
        assert all(turn(a, b, p) >= 0 for p in points)


@pytest.mark.parametrize("count", [1, 3, 500])
def test_degenerate_sets(count):
    assert convex_hull(np.full(count, 2 - 1j)).tolist() == [2 - 1j]
    line = np.arange(count + 1)
    for way in (1, 1j, 1 + 1j, 1 - 2j):
        ends = {complex(0), complex(count * way)}
        assert set(convex_hull(line * way + 0j).tolist()) == ends


def test_one_set_only():
    with pytest.raises(InputError, match="one set"):
        convex_hull(np.zeros((2, 3), complex))
