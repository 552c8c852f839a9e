"""The problem cd/{axis}/two-controllers-switched at a small size, and its checks."""

import pytest
from workbench.plants.cd_drive.tolerance.two_controllers_switched.problem import (
    CASES,
    two_controllers_switched,
)

import workbench as wb
from workbench.errors import InputError


@pytest.fixture(scope="module")
def focus(slower):
    study = two_controllers_switched("focus", slower["focus"], scenarios=7, drives=1)
    return study, wb.solve(study)


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_the_comparison_is_certified(focus):
    _, solution = focus
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate


def test_a_slow_controller_alone_leaves_more_of_the_deviation(focus):
    rms = focus[1].answer["deviation"].sel(drive="CD1").isel(circumstance=0)  # deviation alone
    assert rms.sel(case="fast") < rms.sel(case="slow")
    assert rms.sel(case="switched") == pytest.approx(float(rms.sel(case="fast")), rel=0.2)


@pytest.mark.parametrize(
    ("name", "factor", "check"), [("deviation", 1.1, "replay"), ("arm", 0.5, "arms")]
)
def test_the_checks_can_fail(focus, name, factor, check):
    study, solution = focus
    spoiled = solution.answer.copy(deep=True)
    spoiled[name] = spoiled[name] * factor + 1e-3
    assert check in failures(study, spoiled)


def test_a_loop_too_near_to_instability_is_a_failure(focus, slower):
    study = two_controllers_switched("focus", slower["focus"], 6.0, scenarios=7, drives=1)
    assert "fast loop" in failures(study, focus[1].answer)


def test_figures_tables_and_metrics(focus):
    study, solution = focus
    for figure in study.figures(solution.answer).values():
        figure.canvas.draw()
    assert all("|" in text for text in study.tables(solution.answer).values())
    assert {f"balloon_{case}" for case in CASES} <= set(study.metrics(solution.answer))


def test_wrong_parameters_are_named():
    with pytest.raises(InputError, match="fast_db"):
        wb.load("cd/focus/two-controllers-switched", fast_db=7.0)
    with pytest.raises(InputError, match="scenarios"):
        wb.load("cd/focus/two-controllers-switched", scenarios=0)
