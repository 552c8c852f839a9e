import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from lanes import thinned

from workbench.geometry.exact_circle import exact_circle

ROUNDING = 8 * np.finfo(float).eps
"""Relative: of two differences and their hypotenuse, and of the steps outward from these."""

coordinates = st.one_of(st.integers(-3, 3), st.floats(-10, 10, width=16))
point_sets = st.lists(st.builds(complex, coordinates, coordinates), min_size=1, max_size=12).map(
    np.array
)


def random_set(rng, kind, count):
    normal = rng.normal(size=count) + 1j * rng.normal(size=count)
    match kind:
        case "uniform":
            return rng.uniform(size=count) + 1j * rng.uniform(size=count)
        case "clustered":
            return normal * 10 ** rng.uniform(-6, 0, count)
        case "nearly collinear":
            thin = normal.real + 1j * normal.imag * 10 ** rng.uniform(-14, -2)
            return thin * np.exp(1j * rng.uniform(0, 2 * np.pi))
        case "duplicated":
            return normal[rng.integers(0, 2 + count // 3, count).clip(max=count - 1)]
        case "on a circle":
            return 3 + np.exp(1j * rng.uniform(0, 2 * np.pi, count))


def excess(points, center, radius):
    """The largest distance from the centre, less the radius, in extended precision."""
    away = np.abs(points.astype(np.clongdouble) - np.asarray(center)[..., None])
    return float(np.max(away - np.asarray(radius)[..., None]))


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "kind", thinned(["clustered", "uniform", "nearly collinear", "duplicated", "on a circle"], 2)
)
def test_same_radius_as_geos(kind):
    rng = np.random.default_rng(5)
    for count in rng.integers(3, 201, 2000):
        points = random_set(rng, kind, count)
        pairs = shapely.MultiPoint(np.column_stack([points.real, points.imag]))
        reference = shapely.minimum_bounding_radius(pairs)
        center, radius = exact_circle(points)
        assert radius == pytest.approx(reference, rel=1e-9)
        assert excess(points, center, radius) <= 0


def test_batch_is_set_by_set():
    rng = np.random.default_rng(6)
    points = rng.normal(size=(3, 4, 7)) + 1j * rng.normal(size=(3, 4, 7))
    center, radius = exact_circle(points)
    assert center.shape == radius.shape == (3, 4)
    for index in np.ndindex(3, 4):
        assert (center[index], radius[index]) == exact_circle(points[index])


@pytest.mark.parametrize("count", [3, 4, 5, 6, 7, 12, 100, 1001])
@pytest.mark.parametrize("turned", [0.0, 0.3])
def test_regular_polygons(count, turned):
    corners = np.exp(1j * (turned + 2 * np.pi * np.arange(count) / count))
    center, radius = exact_circle(5 + corners)
    assert center == pytest.approx(5, abs=1e-14)
    assert radius == pytest.approx(1, rel=1e-14)


@pytest.mark.parametrize(
    ("points", "center", "radius"),
    [
        ([2 + 1j], 2 + 1j, 0),
        ([2 + 1j] * 4, 2 + 1j, 0),
        ([0j, 2], 1, 1),
        ([0j, 1, 2, 2, 0], 1, 1),
        ([0j, 1, 1j], 0.5 + 0.5j, np.sqrt(0.5)),
        ([0j, 1, 1j, 1 + 1j], 0.5 + 0.5j, np.sqrt(0.5)),
        ([1e8, 1e8 + 2j], 1e8 + 1j, 1),
    ],
)
def test_degenerate_sets(points, center, radius):
    found = exact_circle(points)
    assert found[0] == center
    assert found[1] == pytest.approx(radius, rel=ROUNDING)
    assert found[1] >= radius


@pytest.mark.parametrize("exponent", [-1060, -1000, -500, 500, 1000, 1020])
def test_extreme_scales(exponent):
    points = np.array([1, -1 + 0.5j, 1j, -0.25j])
    scaled = np.ldexp(points.real, exponent) + 1j * np.ldexp(points.imag, exponent)
    radius, large = exact_circle(points)[1], exact_circle(scaled)
    assert large[1] == pytest.approx(
        np.ldexp(radius, exponent), rel=1e-3 if exponent < -1050 else 1e-14
    )
    assert excess(scaled, *large) <= 0


@given(point_sets, st.randoms(use_true_random=False))
def test_invariance(points, random):
    center, radius = exact_circle(points)
    size = np.abs(points).max()
    assert excess(points, center, radius) <= 0

    def check(moved, expected_center, expected_radius):
        found = exact_circle(moved)
        scale = np.abs(moved).max() + expected_radius
        assert found[1] == pytest.approx(expected_radius, rel=1e-14, abs=ROUNDING * scale)
        assert found[0] == pytest.approx(expected_center, rel=0, abs=1e-7 * scale)

    turn = np.exp(1j * random.uniform(0, 7))
    check(points + 100, center + 100, radius)
    check(points * turn, center * turn, radius)
    check(points.conj(), center.conj(), radius)
    check(np.array(random.sample(points.tolist(), points.size)), center, radius)
    scaled = exact_circle(points * 2.0**40)
    assert scaled[0] == center * 2.0**40
    assert scaled[1] == pytest.approx(radius * 2.0**40, rel=ROUNDING)
    assert radius <= size * (1 + ROUNDING)
