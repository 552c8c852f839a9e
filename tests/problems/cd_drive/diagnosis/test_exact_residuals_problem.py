"""Residuals of u and f_en that are zero without a fault, by the sign of the condition."""

import numpy as np
import pytest
from workbench.plants.cd_drive.control.control_problem import optical_gain
from workbench.plants.cd_drive.diagnosis.exact_residuals import (
    FILTERS,
    FREQUENCY,
    exact_residuals,
    leaks_of,
    nominal_response,
    scratch,
)
from workbench.plants.cd_drive.drive.plants import nominal_response as by_elements

import workbench as wb
from workbench.errors import WorkbenchError
from workbench.study.declarations import identifier
from workbench.systems.generalised_plant import response


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    task = exact_residuals(request.param)
    return task, wb.solve(task)


@pytest.mark.cases(1)
def test_the_certificate_holds_and_there_is_a_figure(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"figure-7-3"}


def test_the_model_beside_is_the_drives_own(solved):
    """H_photo = 1 / K_optn and H_act = -ACT, by the element equations of chapter 3."""
    task, solution = solved
    found = response(task.filters(solution.answer)["model beside, equation 7.6"], _omega())
    K_optn = optical_gain(task.axis)
    assert found[:, 0, 0] == pytest.approx(1.0 / K_optn, rel=1e-9)
    lens = by_elements(task.axis, FREQUENCY, antialiasing=False) / K_optn
    assert found[:, 0, 1] == pytest.approx(-lens, rel=1e-8)


def test_each_sign_is_right_for_one_equation_and_doubles_for_the_other(solved):
    task, solution = solved
    numbers = task.metrics(solution.answer)
    assert numbers["leak_plus_equation_7_6"] < 1e-9 > numbers["leak_minus_equation_7_30"]
    assert numbers["least_leak_minus_equation_7_6"] == pytest.approx(2.0, rel=1e-9)
    assert numbers["leak_plus_equation_7_30"] == pytest.approx(2.0, rel=1e-9)


def test_table_3_2_is_the_model():
    for axis in ("focus", "radial"):
        expected = by_elements(axis, FREQUENCY, antialiasing=False)
        assert nominal_response(axis) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("wrong", ["sign", "gain", "pole"])
def test_another_generator_is_rejected(solved, name, wrong):
    task, solution = solved
    answer = solution.answer.copy(deep=True)
    prefix = identifier(name)
    if wrong == "pole":
        answer[f"{prefix}_A"].values *= 1.001
    else:
        answer[f"{prefix}_B"].values[:, 1] *= -1.0 if wrong == "sign" else 1.001
    filters = task.filters(answer)
    answer["leak"].values[:] = leaks_of(task.axis, filters)
    failed = [one.name for one in task.certify(answer, 1e-6).checks if not one.holds]
    assert "zero without a fault" in failed


def test_gains_that_are_not_those_of_the_generators_are_rejected(solved):
    task, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["leak"].values *= 0.5
    assert not task.certify(answer, 1e-6).holds


def test_a_scratch_lasts_as_long_as_it_takes_to_pass():
    time = np.linspace(0.0, 0.2, 200001)
    covered = time[scratch(time) > 0.0]
    assert covered[-1] - covered[0] == pytest.approx(1.2e-3 / 1.3, rel=1e-2)
    assert scratch(time).max() == pytest.approx(5e-6, rel=1e-4)


def test_an_unstable_generator_is_refused():
    with pytest.raises(WorkbenchError):
        wb.load("cd/focus/exact-residuals", pole_hz=-1.0)


def _omega():
    return 2 * np.pi * FREQUENCY
