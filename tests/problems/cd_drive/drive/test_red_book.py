"""The disturbance envelope of the Red Book and its corners."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive import red_book, tables

from workbench import load, solve
from workbench.errors import InputError


@pytest.mark.parametrize(
    ("axis", "lower", "upper"), [("focus", 22.5, 503.3), ("radial", 12.0, 581.2)]
)
def test_corners(axis, lower, upper):
    assert red_book.corners(axis) == pytest.approx((lower, upper), abs=0.05)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_envelope(axis):
    limits = tables.red_book(axis)
    lower, upper = red_book.corners(axis)
    between = np.sqrt(lower * upper)
    found = red_book.envelope(axis, [1.0, lower, between, upper, 5000.0])
    falling = limits.acceleration / (2 * np.pi * between) ** 2
    assert found == pytest.approx(
        [limits.deviation, limits.deviation, falling, *2 * [limits.deviation_above]]
    )
    fine = red_book.envelope(axis, np.geomspace(0.1, 1e5, 1000))
    assert (np.diff(fine) <= 0).all()


def test_errors():
    with pytest.raises(InputError, match=r"focus.*radial"):
        red_book.envelope("vertical", [1.0])
    with pytest.raises(InputError, match=r"contains 0\.0"):
        red_book.envelope("focus", [0.0, 1.0])
    with pytest.raises(InputError, match="frequencies"):
        load("cd/red-book", frequencies=1)


def test_problem():
    study = load("cd/red-book", frequencies=50)
    solution = solve(study)
    assert solution.certificate.holds
    metrics = study.metrics(solution.answer)
    assert metrics["upper_corner_radial_hz"] == pytest.approx(581.2, abs=0.1)
    # 500 um against 2 um, 70 um against 0.2 um.
    assert metrics["attenuation_focus_db"] == pytest.approx(20 * np.log10(250))
    assert metrics["attenuation_radial_db"] == pytest.approx(20 * np.log10(350))
    assert metrics["error_acceptable_from_focus_hz"] == pytest.approx(355.9, abs=0.1)
    assert set(study.figures(solution.answer)) == {"figure-2-12"}
    assert "22.5, 503.3" in study.tables(solution.answer)["tables-2-3-2-4"]


def test_a_wrong_envelope_is_found():
    study = load("cd/red-book", frequencies=50)
    answer = solve(study).answer
    answer["envelope"] *= 1.1
    assert len(study.certify(answer, 1e-6).failures) == 4
