"""Strategies that are told a wrong rotation."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.scratch_draws import ScratchDraw
from workbench.plants.cd_drive.tolerance.wrong_rotation.problem import WRONG, wrong_rotation

import workbench as wb
from workbench.solvers import Options


def test_a_right_rotation_is_the_experiment_of_the_strategies():
    task = wrong_rotation("focus", draws=1)
    scratch = ScratchDraw.drawn("focus", 5)
    plain = task.experiment.scenario("nominal", "B", scratch).run()
    assert task.outcome("B", 0.0, scratch) == task.experiment.outcome(plain, scratch.angle)
    assert task.outcome("B", 0.2, scratch) != task.outcome("B", 0.0, scratch)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", pytest.param("radial", marks=pytest.mark.slow)])
def test_another_seed_changes_no_verdict(axis):
    task = wrong_rotation(axis, draws=4)
    for seed in (0, 1):
        solution = wb.solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        metrics = task.metrics(solution.answer)
        assert metrics["below_reference_B_1pct"] > metrics["below_reference_B_50pct"]
        assert metrics["over_reference_B_50pct_mean"] > 1.0
        table = task.tables(solution.answer)["wrong-rotation"]
        assert table.count("\n") == 2 + 1 + 2 * len(WRONG)
        assert np.isfinite(list(metrics.values())).all()


def test_an_unknown_drive_is_named():
    solution = wb.solve(wrong_rotation("focus", drive="CD13", draws=1))
    assert solution.answer is None and "CD13" in solution.message
