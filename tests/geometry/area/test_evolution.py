"""Stadiums of the smallest area by differential evolution, beside the search and IPOPT."""

import numpy as np
import pytest
from hypothesis import given, settings
from test_smallest_area import CASES, DEGENERATE, point_sets, random_sets

import workbench as wb
from workbench.geometry import SmallestAreaStadium, smallest_area_stadium
from workbench.geometry.area.evolution import ShapeFamily
from workbench.program import methods
from workbench.solvers import Options


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
def test_it_finds_the_smallest_area(case):
    points = random_sets(11, 8, 10)
    program = SmallestAreaStadium(points, **CASES[case])
    solution = wb.solve(program, method="evolution")
    assert solution.certificate.failures == ()
    assert solution.certificate.gap.value < 1e-6


@pytest.mark.cases(1)
@pytest.mark.parametrize("case", CASES)
@settings(max_examples=10, deadline=None)
@given(point_sets)
def test_it_is_valid_and_never_below_the_search(case, points):
    program = SmallestAreaStadium(points, **CASES[case])
    solution = wb.solve(program, method="evolution")
    assert solution.certificate.valid, solution.certificate.failures
    search = smallest_area_stadium(points, **CASES[case]).area
    rounding = 1e-14 * np.abs(points).max() ** 2  # of points on a line both areas are rounding
    assert np.all(solution.answer.area >= search * (1 - 1e-9) - rounding)


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_sets_are_covered(name):
    points, _ = DEGENERATE[name]
    assert wb.solve(SmallestAreaStadium(points), method="evolution").certificate.valid


def test_another_seed_searches_elsewhere_and_ends_at_the_same_area():
    points = random_sets(12, 3, 9)
    answers = [
        wb.solve(SmallestAreaStadium(points), method="evolution", options=Options(seed=seed)).answer
        for seed in (0, 0, 1)
    ]
    np.testing.assert_array_equal(answers[0].angle, answers[1].angle)
    assert np.any(answers[0].angle != answers[2].angle)
    np.testing.assert_allclose(answers[0].area, answers[2].area, rtol=1e-7)


@pytest.mark.parametrize("centred", [False, True])
@pytest.mark.parametrize("angle", [None, 0.4])
def test_every_member_holds_the_corners_and_none_of_its_numbers_is_shorter(centred, angle):
    corners = random_sets(13, 7)
    corners -= 0 if centred else corners.mean()
    family = ShapeFamily(corners, float(np.abs(corners).max()), centred, angle)
    numbers = np.random.default_rng(0).uniform(size=(len(family.bounds), 50))
    radius, center, half, turn = family.members(numbers)
    away = (corners[:, None] - center) * np.exp(-1j * turn)
    beyond = np.hypot(np.maximum(np.abs(away.real) - half, 0.0), away.imag)
    assert np.all(beyond <= radius * (1 + 1e-9))
    shorter = np.hypot(np.maximum(np.abs(away.real) - 0.99 * half, 0.0), away.imag)
    long = half > 1e-3
    assert np.all((shorter.max(axis=0) > radius * (1 + 1e-12))[long])
    assert long.any()
    np.testing.assert_allclose(family.areas(numbers), np.pi * radius**2 + 4 * radius * half)


def test_its_name_is_known():
    assert {"search", "evolution", "ipopt"} <= set(methods(SmallestAreaStadium))
