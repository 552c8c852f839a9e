"""How long a defect is seen after it has passed."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.tolerance.after_defects import (
    LOOPS,
    SIGNALS,
    after_defects,
    effects,
    last_beyond,
)

import workbench as wb
from workbench.solvers import Options


@pytest.fixture(scope="module")
def solved():
    task = after_defects("focus", defects=3, draws=1)
    return task, wb.solve(task)


def test_the_last_sample_beyond_a_limit():
    assert last_beyond(np.array([3.0, 0.0, 2.0, 0.5]), 1.0) == 3
    assert last_beyond(np.array([0.1, 0.2]), 1.0) == 0


def test_before_the_first_defect_there_is_no_effect():
    task = after_defects("focus", defects=1, draws=1)
    passed, clean = task.pair(LOOPS[1], 5)
    start, end = passed.faults[0]
    error, total, _ = effects(passed, clean)
    assert error[: start - 1].max() == 0.0 == total[: start - 1].max()
    assert total[start:end].max() > 0.3
    assert error[end : end + round(3e-3 * RATE)].max() > 0.01


@pytest.mark.cases(0)
def test_the_certificate_holds_and_there_is_a_figure(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"figure-7-4"}
    assert "durations" in task.tables(solution.answer)


def test_the_error_settles_within_periods_of_the_crossover(solved):
    _, solution = solved
    settles = 1e3 * solution.answer["settles"]
    error, total = (settles.sel(signal_without_noise=one) for one in SIGNALS[:2])
    assert 0.2 < float(error.min()) < float(error.max()) < 5.0
    assert float(total.max()) <= 2e3 / RATE


@pytest.mark.parametrize("name", ["settles", "after", "lost"])
def test_a_wrong_answer_is_rejected(solved, name):
    task, solution = solved
    answer = solution.answer.copy(deep=True)
    answer[name].values[:] = 1.0
    assert not task.certify(answer, 1e-6).holds


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_another_seed_changes_no_verdict(axis):
    task = replace(after_defects(axis, draws=3))
    for seed in (0, 1):
        solution = wb.solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
