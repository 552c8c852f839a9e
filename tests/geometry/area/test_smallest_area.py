"""Stadiums of the smallest area: certified, never worse than circle and narrowest stadium."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes import thinned
from scipy.optimize import minimize_scalar

import workbench as wb
from workbench.errors import InputError
from workbench.geometry import (
    SmallestAreaStadium,
    Stadium,
    narrowest_stadium,
    smallest_area_stadium,
    smallest_circle,
)
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome

HIGH = 1e-9
CASES = {
    "free": {},
    "centre": {"center": 0.5 + 1j},
    "angle": {"angle": 0.7},
    "both": {"center": 0.5 + 1j, "angle": 0.7},
}
TRIANGLE = np.array([1, -1 + 0.5j, 1j])
DEGENERATE = {
    "one point": (np.array([2 + 1j]), 1),
    "the origin": (np.array([0j]), 1),
    "two points": (np.array([0j, 2j]), 1),
    "all equal": (np.full(5, 2 + 1j), 1),
    "collinear": (np.array([0j, 1 + 1j, 3 + 3j, 2 + 2j]), 1),
    "collinear, turned": (np.array([0, 1, 3, 7.3]) * np.exp(0.7j), 1),
    "duplicates": (np.array([1] + 100 * [-1] + [1j]), 1),
    "square": (np.array([0j, 1, 1j, 1 + 1j]), 1),
    "polygon": (np.exp(2j * np.pi * np.arange(40) / 40), 1),
    "cocircular": (3 + np.exp(1j * np.random.default_rng(0).uniform(0, 7, 40)), 1),
    "tiny": (1e-300 * TRIANGLE, 1e-300),
    "huge": (1e300 * TRIANGLE, 1e300),
    "far": (1e8 + TRIANGLE, 1),
    "clustered": (np.array([0, 1e-8, 1e-6j, 1e-4, 1e-2j, 1]), 1),
}
coordinates = st.one_of(st.integers(-3, 3), st.integers(-512, 512).map(lambda k: k / 64))
point_sets = st.lists(st.builds(complex, coordinates, coordinates), min_size=1, max_size=9).map(
    np.array
)


def random_sets(seed, *shape):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def certify(points, given, answer, tolerance=HIGH):
    return SmallestAreaStadium(points, **given).certify(answer, tolerance, optimal=True)


# --- what the search finds is certified ---------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.parametrize("where", ["at a point", "beside"])
def test_the_search_is_certified_for_degenerate_sets(name, case, where):
    points, size = DEGENERATE[name]
    chosen = dict(CASES[case])
    if "center" in chosen:
        chosen["center"] = points[0] + (0 if where == "at a point" else (2 - 1j) * size)
    elif where == "at a point":
        pytest.skip("no centre given")
    solution = solve(SmallestAreaStadium(points, **chosen), options=Options(tolerance="high"))
    assert solution.certificate.failures == ()
    assert solution.outcome is Outcome.SOLVED


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
@settings(derandomize=True, deadline=None, max_examples=40)
@given(point_sets)
def test_the_search_is_certified(case, points):
    answer = smallest_area_stadium(points, **CASES[case])
    assert certify(points, CASES[case], answer).failures == ()


@pytest.mark.parametrize("case", ["free", "centre"])
@pytest.mark.parametrize("thin", [1e-3, 1e-6, 1e-9, 1e-14])
def test_the_search_is_certified_for_nearly_collinear_sets(case, thin):
    normal = random_sets(2, 15, 9)
    points = (normal.real + thin * 1j * normal.imag) * np.exp(0.7j)
    given = {} if case == "free" else {"center": points[:, 0]}
    assert certify(points, given, smallest_area_stadium(points, **given)).failures == ()


@pytest.mark.cases(0)
def test_its_area_does_not_depend_on_place_size_and_direction():
    points = random_sets(3, 4, 8)
    area = smallest_area_stadium(points).area
    for factor, shift in ((1j, 0), (1e-6 * np.exp(0.3j), 0), (3.0, 4 - 2j), (-1.0, 1e3)):
        moved = smallest_area_stadium(factor * points + shift)
        np.testing.assert_allclose(moved.area, abs(factor) ** 2 * area, rtol=1e-8)
    np.testing.assert_allclose(smallest_area_stadium(points.conj()).area, area, rtol=1e-8)


@pytest.mark.cases(0)
def test_it_lies_between_circle_and_narrowest_stadium():
    points = random_sets(4, 30, 12)
    best, narrowest = smallest_area_stadium(points), narrowest_stadium(points)
    circle = np.pi * smallest_circle(points).radius ** 2
    assert np.all(best.area <= np.minimum(narrowest.area, circle) * (1 + 1e-9))
    assert np.all(best.radius >= narrowest.radius * (1 - 1e-12))
    assert np.any(best.area < 0.9 * np.minimum(narrowest.area, circle))


def test_it_is_the_narrowest_of_points_on_a_line():
    points = np.array([0, 1, 3, 7.3]) * np.exp(0.7j) + 1
    answer = smallest_area_stadium(points)
    assert answer.radius <= 1e-14
    assert answer.half_length == pytest.approx(3.65)
    assert answer.angle == pytest.approx(0.7)


@pytest.mark.parametrize(("length", "width"), [(1, 1), (3, 1), (10, 1), (1.2, 1)])
def test_of_a_rectangle_it_is_known_along_its_side(length, width):
    """With the segment along the long side, the corners lie on the round ends."""
    corners = np.array([0, length, 1j * width, length + 1j * width])

    def area(r):
        half_length = max(length / 2 - np.sqrt(r**2 - width**2 / 4), 0.0)
        return np.pi * r**2 + 4 * r * half_length

    most = np.hypot(length, width) / 2
    along = minimize_scalar(
        area, bounds=(width / 2, most), options={"xatol": 1e-12}, method="bounded"
    )
    assert smallest_area_stadium(corners, angle=0).area == pytest.approx(along.fun, rel=1e-9)
    free = smallest_area_stadium(corners).area
    assert free <= along.fun * (1 + 1e-9)
    if length >= 3:
        assert free == pytest.approx(along.fun, rel=1e-9)


def tried(points, angles, radii, places):
    """Least area over a grid of angles, radii and axes: an upper bound, by brute force."""
    best = np.inf
    for angle in angles:
        turned = points * np.exp(-1j * angle)
        t, h = turned.real, turned.imag
        half = (h.max() - h.min()) / 2
        r = half * (1 + radii)[:, None, None]
        axis = (h.max() + h.min()) / 2 + (r - half) * places[None, :, None]
        room = np.sqrt(np.maximum(r**2 - (h - axis) ** 2, 0))
        length = np.maximum((t - room).max(axis=-1) - (t + room).min(axis=-1), 0) / 2
        best = min(best, float((np.pi * r[..., 0] ** 2 + 4 * r[..., 0] * length).min()))
    return best


@pytest.mark.parametrize("seed", thinned([1, 2, 3, 4, 5], 2))
def test_brute_force_finds_nothing_better(seed):
    points = random_sets(seed, 7)
    best = smallest_area_stadium(points).area
    angles, radii = np.linspace(0, np.pi, 361), np.concatenate([[0], np.geomspace(1e-4, 2, 80)])
    found = tried(points, angles, radii, np.linspace(-1, 1, 21))
    assert best * (1 - 1e-9) <= found <= best * 1.02
    assert SmallestAreaStadium(points).area_bound(smallest_area_stadium(points)) <= found


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", ["free", "centre"])
def test_no_stadium_of_another_angle_is_below_the_bound(case):
    points, given = random_sets(12, 6, 9), CASES[case]
    bound = SmallestAreaStadium(points, **given).area_bound(smallest_area_stadium(points, **given))
    for angle in np.linspace(0, 3, 31):
        assert np.all(narrowest_stadium(points, **given, angle=angle).area >= bound)
        assert np.all(smallest_area_stadium(points, **given, angle=angle).area >= bound)


# --- and nothing else -----------------------------------------------------------------------------

WRONG = {
    "shrunk": lambda s: replace(s, radius=s.radius * (1 - 1e-6)),
    "inflated": lambda s: replace(s, radius=s.radius * (1 + 1e-6)),
    "radius of zero": lambda s: replace(s, radius=0 * s.radius),
    "radius negative": lambda s: replace(s, radius=-s.radius),
    "shortened": lambda s: replace(s, half_length=s.half_length - 1e-3 * s.radius),
    "lengthened": lambda s: replace(s, half_length=s.half_length + 1e-6 * s.radius),
    "no length": lambda s: replace(s, half_length=0 * s.half_length),
    "shifted": lambda s: replace(s, center=s.center + 1e-6 * s.radius),
    "turned": lambda s: replace(s, angle=s.angle + 1e-4),
    "upright": lambda s: replace(s, angle=s.angle + np.pi / 2),
    "permuted": lambda s: Stadium(
        *(np.roll(x, 1) for x in (s.center, s.radius, s.half_length, s.angle))
    ),
    "one too large": lambda s: replace(s, radius=s.radius * np.array([1.01, 1, 1, 1, 1])),
    "radius no number": lambda s: replace(s, radius=s.radius * np.nan),
    "radius infinite": lambda s: replace(s, radius=s.radius * np.inf),
    "centre no number": lambda s: replace(s, center=s.center * np.nan),
}


@pytest.mark.cases(1)
@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("case", CASES)
def test_wrong_answers_are_rejected(case, wrong):
    points = random_sets(6, 5, 12)
    best = smallest_area_stadium(points, **CASES[case])
    assert certify(points, CASES[case], best).holds
    assert not certify(points, CASES[case], WRONG[wrong](best)).holds


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
def test_narrowest_stadiums_and_circles_are_valid_with_a_gap(case):
    points = random_sets(7, 5, 12)
    best = smallest_area_stadium(points, **CASES[case])
    other = narrowest_stadium(points, **CASES[case])
    certificate = certify(points, CASES[case], other)
    assert certificate.valid and not certificate.holds
    missed = (1 - best.area / other.area).max()
    assert certificate.gap.value == pytest.approx(missed, rel=1e-6)
    solution = solve(SmallestAreaStadium(points, **CASES[case]), method="narrowest")
    assert solution.outcome is Outcome.SOLVED  # it claims no optimum
    assert solution.certificate.gap.value == pytest.approx(certificate.gap.value)


def test_the_bound_holds_whatever_the_answer_was():
    points = random_sets(8, 4, 9)
    best = smallest_area_stadium(points)
    program = SmallestAreaStadium(points)
    for factor in (1e-3, 0.9, 1.5, 1e3):
        wrong = replace(best, radius=factor * best.radius, angle=best.angle + 1.0)
        assert np.all(program.area_bound(wrong) <= best.area)
    large = replace(best, radius=10 * best.radius)
    np.testing.assert_allclose(program.area_bound(large), best.area, rtol=1e-6)


# --- methods ------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES)
def test_ipopt_finds_the_same(case):
    points = random_sets(9, 2, 8)
    best = smallest_area_stadium(points, **CASES[case])
    solution = solve(SmallestAreaStadium(points, **CASES[case]), method="ipopt")
    assert solution.certificate.valid
    assert np.all(solution.answer.area >= best.area * (1 - 1e-9))
    np.testing.assert_allclose(solution.answer.area, best.area, rtol=5e-3)  # a local minimum


def test_what_the_methods_claim():
    every = methods(SmallestAreaStadium)
    assert every["search"].optimal
    assert not every["narrowest"].optimal and not every["ipopt"].optimal
    assert "exact" not in every and "thesis" not in every


def test_it_is_offered_beside_the_narrowest():
    points = random_sets(10, 2, 5)
    np.testing.assert_array_equal(
        wb.smallest_area_stadium(points).area, smallest_area_stadium(points).area
    )
    with pytest.raises(InputError, match="x, y pairs"):
        wb.smallest_area_stadium([[0.0, 1.0], [1.0, 0.0]])
    with pytest.raises(InputError, match="center must be finite"):
        wb.smallest_area_stadium(points, center=np.nan)


def test_its_dataset_comes_back_and_its_metrics_are_its_sizes():
    points = random_sets(11, 3, 6)
    program, best = SmallestAreaStadium(points), smallest_area_stadium(points)
    back = program.from_dataset(program.to_dataset(best))
    np.testing.assert_array_equal(back.area, best.area)
    assert program.metrics(best)["area_peak"] == pytest.approx(best.area.max())
