"""The certificates' lower bounds against brute force in extended precision."""

import resource
import time
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from lanes import thinned

from workbench.geometry.bounds import circle_radius_bound, least_half_width
from workbench.geometry.enclosing_stadium import Stadium
from workbench.geometry.exact_circle import exact_circle
from workbench.geometry.stadium import NarrowestStadium

EPS = np.finfo(float).eps
KINDS = ["normal", "clustered", "thin", "duplicated", "on a circle", "grid", "line", "coincident"]
PLACES = ["near", "far", "small", "large"]


def random_set(rng, kind, place, count):
    normal = rng.normal(size=count) + 1j * rng.normal(size=count)
    points = {
        "normal": normal,
        "clustered": normal * 10 ** rng.uniform(-8, 0, count),
        "thin": normal.real + 1j * normal.imag * 10 ** rng.uniform(-17, -1),
        "duplicated": normal[rng.integers(0, 2 + count // 3, count).clip(max=count - 1)],
        "on a circle": np.exp(1j * rng.uniform(0, 7, count)),
        "grid": np.round(2 * normal),
        "line": normal.real + 0j,
        "coincident": np.full(count, normal[0]),
    }[kind]
    turned = points * np.exp(1j * rng.uniform(0, 7))
    return {
        "near": turned,
        "far": turned + 1e8 * np.exp(1j * rng.uniform(0, 7)),
        "small": turned * 1e-300,
        "large": turned * 1e300,
    }[place]


def smallest_radius(points):
    """Least largest distance over the circles of all pairs and triples, in extended precision."""
    points = np.unique(points).astype(np.clongdouble)
    points = points - points[0]
    size = np.abs(points).max()
    if size == 0:
        return size
    points = points / size
    centers = [(a + b) / 2 for a, b in combinations(points, 2)]
    for a, b, c in combinations(points, 3):
        b, c = b - a, c - a
        area = 2 * (b.real * c.imag - b.imag * c.real)
        if area != 0:
            bb, cc = np.abs(b) ** 2, np.abs(c) ** 2
            centers.append(
                a + ((c.imag * bb - b.imag * cc) + 1j * (b.real * cc - c.real * bb)) / area
            )
    return np.abs(points - np.array(centers)[:, None]).max(axis=1).min() * size


def half_width(points, center=None):
    """Least half-width over the directions of all pairs of points, in extended precision."""
    points = points.astype(np.clongdouble)
    points = points - (points[0] if center is None else center)
    if center is not None:
        points = np.concatenate([points, -points])
    pairs = np.array([b - a for a, b in combinations(points, 2) if a != b])
    if not pairs.size:
        return np.longdouble(0)
    across = (points * (pairs / np.abs(pairs)).conj()[:, None]).imag
    return np.ptp(across, axis=1).min() / 2


@contextmanager
def limited_memory(gigabytes):
    """A bisection that never settles must end here, not in the machine's memory."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    old = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + int(gigabytes * 2**30), old[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, old)


def circle_bound(points, center):
    return circle_radius_bound(points, np.asarray(center))


# --- circles ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_circle_bound_is_below_the_least_radius_and_meets_it_at_the_optimum(kind, place):
    rng = np.random.default_rng(21)
    for count in rng.integers(1, 13, 20):
        points = random_set(rng, kind, place, count)
        reach = np.abs(points.astype(np.clongdouble)).max()
        least = smallest_radius(points)
        best = exact_circle(points)[0][()]
        spread = float(np.abs(points - best).max())
        for center in (best, points[0], best + 3 * spread * np.exp(1j * rng.uniform(0, 7))):
            assert circle_bound(points, center) <= least * (1 + 1e-15) + EPS * reach
        assert circle_bound(points, best) >= least * (1 - 1e-9) - 8 * EPS * reach


@pytest.mark.cases(0)
@pytest.mark.parametrize("away", thinned([1e9, 1e3, 1e6, 1e12, 1e200], 5))
def test_circle_bound_holds_wherever_the_answer_is(away):
    # a bound of the optimum, whatever the answer was
    rng = np.random.default_rng(22)
    hexagon = np.exp(2j * np.pi * np.arange(6) / 6)
    for _ in range(300):
        assert circle_bound(hexagon, away * rng.uniform(0.5, 2)) <= 1 + 1e-12


@pytest.mark.parametrize(
    "points",
    [
        np.array([1] + 100 * [-1], dtype=complex),
        np.array([1] + 500 * [1j] + [-1]),
        np.array(300 * [1] + 300 * [1j] + 300 * [-1] + [-1j]),
        np.exp(2j * np.pi * np.arange(1000) / 1000),
        np.exp(2j * np.pi * np.arange(20_000) / 20_000),
        np.exp(1j * np.random.default_rng(0).uniform(0, 7, 1000)),
    ],
    ids=["pair", "three", "four", "polygon", "large polygon", "cocircular"],
)
def test_circle_bound_is_tight_when_many_points_are_on_the_circle(points):
    assert circle_bound(points, 0j) >= 1 - 1e-9
    assert circle_bound(points, exact_circle(points)[0][()]) >= 1 - 1e-9


@pytest.mark.parametrize("error", [1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("kind", ["normal", "clustered", "line", "on a circle"])
def test_circle_bound_is_sharp_for_inexact_centers(kind, error):
    # Or an answer as good as it claims is called inaccurate. Solvers are told a tenth of the
    # tolerance, so a gap of ten times the true one is still good enough.
    rng = np.random.default_rng(23)
    for count in rng.integers(3, 20, 50):
        points = random_set(rng, kind, "near", count)
        center, least = exact_circle(points)
        inexact = center + error * least * np.exp(1j * rng.uniform(0, 7))
        radius = np.abs(points - inexact).max()
        gap = 1 - circle_bound(points, inexact) / radius
        assert gap <= 10 * (1 - least / radius) + 1e-9


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_circle_bound_of_no_number_is_no_number(bad):
    assert np.isnan(circle_radius_bound(np.array([1j, 1]), np.asarray(bad + 0j)))


# --- stadiums ---------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_least_half_width_is_below_and_close_to_brute_force(kind):
    rng = np.random.default_rng(24)
    for count in rng.integers(1, 13, 60):
        points = random_set(rng, kind, "near", count)
        size, least = np.abs(points).max(), half_width(points)
        bound = least_half_width(points[None])[0]
        assert bound <= least * (1 + 1e-15)
        assert bound >= least * (1 - 2e-11) - 8 * EPS * size


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("centered", [False, True])
def test_radius_bound_holds_wherever_the_answer_is(kind, place, centered):
    rng = np.random.default_rng(25)
    for count in rng.integers(1, 10, 6):
        points = random_set(rng, kind, place, count)
        spread = float(np.abs(points - points[0]).max()) or float(np.abs(points).max())
        given = points[0] + 3 * spread * 1j if centered else None
        program = NarrowestStadium(points, center=given)
        least = half_width(points, given)
        for away in (0.0, 1.0, 1e3, 1e7):
            center = points[0] + away * spread * np.exp(1j * rng.uniform(0, 7))
            garbage = Stadium(*(np.asarray(x) for x in (center, 1.0, 0.0, rng.uniform(0, 3))))
            assert program.radius_bound(garbage) <= least * (1 + 1e-15)


@pytest.mark.parametrize("count", [3, 4, 5, 12, 100, 1000])
@pytest.mark.parametrize("turned", [0.0, 0.1])
def test_regular_polygons(count, turned):
    corners = np.exp(1j * (turned + 2 * np.pi * np.arange(count) / count))
    inner = np.cos(np.pi / count)
    least = inner if count % 2 == 0 else (1 + inner) / 2
    bound = least_half_width(corners[None])[0]
    assert least * (1 - 1e-10) <= bound <= least * (1 + 1e-15)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "shape", [(1000, 12), (1, 1_000_000), (1, 2000)], ids=["sets", "points", "cocircular"]
)
def test_bounds_are_quick(shape):
    rng = np.random.default_rng(26)
    points = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    if shape[1] == 2000:
        points = points / np.abs(points)
    start = time.process_time()
    bound = least_half_width(points)
    circle = circle_radius_bound(points, np.zeros(shape[0]))
    assert time.process_time() - start < 10
    assert np.all((bound > 0) & (bound <= np.abs(points).max(axis=-1)))
    assert np.all(circle > 0)


@pytest.mark.parametrize("count", [1, 5])
def test_least_half_width_of_no_number_ends(count):
    points = np.array([[1, 1j, 0], [1, 1j, 2], [0, 1, 2j]], dtype=complex)[:, :count]
    points[1] = np.nan
    with limited_memory(1):
        bound = least_half_width(points)
    assert np.isnan(bound[1])
    np.testing.assert_array_equal(bound[[0, 2]], least_half_width(points[[0, 2]]))
