"""The three nominal models of an axis."""

from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.plants import nominal_response
from workbench.plants.cd_drive.drive.shared_parameters import WINDOWS
from workbench.plants.cd_drive.uncertainty.nominal import (
    CLOSE,
    NOMINAL_FORMS,
    NominalModels,
    steps_of_covers,
)

import workbench as wb


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request, covered):
    axis = request.param
    covers = [covered(axis, shape, "steps") for shape in ("circle", "stadium")]
    runs = [
        SimpleNamespace(data=cover.to_dataset(answer), answer=answer, task=cover)
        for cover, answer in covers
    ]
    study = NominalModels(axis, *runs)
    return study, wb.solve(study)


def test_both_covers_are_by_steps_and_on_one_grid():
    needs = steps_of_covers("radial", frequencies=17)
    assert {name: need.name for name, need in needs.items()} == {
        "circles": "cd/radial/circle-cover",
        "stadiums": "cd/radial/stadium-cover",
    }
    for need in needs.values():
        assert need.method == "steps"
        assert need.parameters["frequencies"] == 17


def test_the_three_agree_closely(solved):
    study, solution = solved
    assert solution.certificate.failures == ()
    metrics = study.metrics(solution.answer)
    assert 0 < metrics["difference_db"] < CLOSE["outside"]
    assert 0 < metrics["difference_at_resonances_db"] < CLOSE["inside"]
    low, high = WINDOWS[study.axis]["first resonance"]
    for form in NOMINAL_FORMS:
        assert low < metrics[f"resonance_{form}_hz"] < high


def test_the_parametric_one_is_table_5_2(solved):
    study, solution = solved
    found = solution.answer["nominal"].sel(form="parametric")
    expected = nominal_response(study.axis, found["frequency"].values, antialiasing=False)
    np.testing.assert_allclose(found.values, expected)


def test_a_nominal_that_differs_is_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["nominal"].loc[{"form": "mixed"}] *= 1.5
    failed = [check.name for check in study.checks(answer, 1e-6) if not check.holds]
    assert "agreement outside" in failed


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    assert study.figures(stored).keys() == {"bode"}
