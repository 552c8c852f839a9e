"""Circles and stadiums on the open loop, and the point -1."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.cd_drive.control.nyquist.problem import (
    COVER_METHODS,
    KINDS,
    SHAPES,
    Nyquist,
    both_covers,
)
from workbench.plants.cd_drive.drive.plants import loop_response

import workbench as wb

pytestmark = pytest.mark.slow  # the whole study is computed


@pytest.fixture(scope="module")
def solved(covered):
    runs = {}
    for shape, method in product(SHAPES, COVER_METHODS):
        cover, answer = covered("focus", shape, method)
        runs[shape, method] = SimpleNamespace(data=cover.to_dataset(answer), task=cover)
    study = Nyquist("focus", runs)
    return study, wb.solve(study)


def test_the_covers_are_asked_for_on_one_grid():
    asked = both_covers("focus", frequencies=33, gain="agc")
    assert len(asked) == 4
    for need in asked.values():
        assert need.parameters == {"frequencies": 33, "gain": "agc"}


def test_the_certificate_holds(solved):
    _, solution = solved
    assert solution.certificate.failures == ()


def test_the_loop_is_that_of_the_drives(solved):
    _, solution = solved
    same = solution.answer.sel(kind="Table 5.2", shape="circle")
    expected = loop_response("focus", same["frequency"].values)
    np.testing.assert_allclose(same["center"], expected, rtol=1e-9)


def test_about_one_nominal_stadiums_are_no_wider(solved):
    _, solution = solved
    same = solution.answer["radius"].sel(kind="Table 5.2")
    assert (same.sel(shape="stadium") <= same.sel(shape="circle") * (1 + 1e-9)).all()
    circles = solution.answer.sel(shape="circle")
    assert (circles["half_length"] == 0).all()


def test_circles_contain_the_critical_point_more_often(solved):
    study, solution = solved
    numbers = study.metrics(solution.answer)
    assert numbers["contains_circle"] > numbers["contains_stadium"]
    assert numbers["distance_circle_low"] < 0
    assert 0 < numbers["distance_circle_high"] < numbers["distance_stadium_high"]


@pytest.mark.parametrize(
    ("name", "factor", "failing"),
    [
        ("radius", 0.9, "drives inside"),
        ("distance", 1.1, "distances"),
        ("L", 1.1, "drives inside"),
    ],
)
def test_what_is_wrong_is_found(solved, name, factor, failing):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer[name] = answer[name] * factor
    assert failing in {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_a_stadium_over_the_critical_point_is_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["distance"].loc[{"shape": "stadium"}] = -1.0
    failed = {check.name for check in study.checks(answer, 1e-6) if not check.holds}
    assert "stadiums contain -1 at fewer frequencies" in failed


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    assert study.tables(stored)["distances"].count("\n") == 2 + len(KINDS) * len(SHAPES)
    assert study.figures(stored).keys() == {"figure-6-8", "steps", "joint", "clearance"}
