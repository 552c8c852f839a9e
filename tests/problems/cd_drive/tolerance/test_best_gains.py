"""Every strategy at several gains, and pairs of switched controllers."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.tolerance.best_gains.cases import CASES, USES, Case, Cases
from workbench.plants.cd_drive.tolerance.best_gains.problem import best_gains

import workbench as wb


@pytest.fixture(scope="module", params=["focus", pytest.param("radial", marks=pytest.mark.slow)])
def found(request, slower):
    task = best_gains(request.param, slower[request.param], scenarios=14, drives=1)
    task = replace(task, cases=replace(task.cases, duration=0.6))
    solution = wb.solve(task)
    assert solution.certificate.holds, solution.certificate
    return task, solution.answer


@pytest.mark.slow
def test_the_best_of_each_use_is_the_best_where_it_is_chosen(found):
    task, answer = found
    tried = answer["balloon"].sel(half="chosen on").values
    for use, number in zip(USES, answer["best"].values, strict=True):
        others = [n for n, case in enumerate(CASES) if case.use == use]
        assert number in others
        assert tried[number] == min(tried[others])
    metrics = task.metrics(answer)
    assert metrics["switched_less_reference_found"] == pytest.approx(
        metrics["balloon_switched"] - metrics["balloon_reference"]
    )
    assert metrics["alone_less_alone_low"] == metrics["alone_less_alone_high"] == 0.0
    assert metrics["A_less_reference_low"] <= metrics["A_less_reference_high"]
    assert task.tables(answer)["balloons"].count("best") == len(USES)


def test_names_tell_cases_apart():
    assert len({case.name for case in CASES}) == len(CASES)
    assert Case("switched", 2.0, None).name == "+2 dB and K-prime"


def test_both_controllers_alike_are_nearly_one_that_sees_all(slower):
    """A pair of equal gains is switched between copies that follow each other."""
    task = best_gains("focus", slower["focus"], scenarios=14, drives=1)
    assert isinstance(task.cases, Cases)
    from workbench.plants.cd_drive.tolerance.ensemble import circumstances

    one = circumstances("focus", 14, 1.0, np.random.default_rng(0))[0]  # the disc alone
    pair = task.cases.error(Case("switched", 0.0, 0.0), one, "CD1")
    single = task.cases.error(Case("alone", 0.0), one, "CD1")
    assert np.sqrt(np.mean((pair - single) ** 2)) < 0.05 * np.sqrt(np.mean(single**2))
