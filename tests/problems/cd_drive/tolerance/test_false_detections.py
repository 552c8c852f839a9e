"""What a false detection costs each strategy."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.scratch_draws import ScratchDraw
from workbench.plants.cd_drive.tolerance.false_detections import STRATEGIES, false_detections

import workbench as wb
from workbench.solvers import Options


def test_the_quality_is_zero_in_the_detection_alone():
    task = false_detections("focus", draws=1)
    scratch = ScratchDraw.drawn("focus", 3)
    start = task.start(scratch)
    for case in ("with", "without"):
        record = task.record("reference", scratch, case)
        inside = (record.time >= start) & (record.time < start + task.lasts)
        expected = 0.0 if case == "with" else 1.0
        assert (record.signals["w_Q"][inside] == expected).mean() > 0.95
        assert (record.light == 1.0).all()


def test_both_records_are_the_same_before_it():
    task = false_detections("focus", draws=1)
    scratch = ScratchDraw.drawn("focus", 4)
    one, other = (task.record("A", scratch, case, noisy=False) for case in ("with", "without"))
    before = one.time < task.start(scratch)
    np.testing.assert_array_equal(one.x[before], other.x[before])
    assert (one.x != other.x)[~before].any()


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_certificate_holds_for_two_seeds_and_wrong_answers_are_rejected(axis):
    task = false_detections(axis, draws=4)
    for seed in (0, 1):
        solution = wb.solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
    assert set(task.figures(solution.answer)) == {"false-detection"}
    assert set(solution.answer["strategy"].values) == set(STRATEGIES)
    swapped = solution.answer["error"].isel(case=slice(None, None, -1)).values
    for wrong in (swapped, np.roll(solution.answer["error"].values, 1, axis=1)):
        answer = solution.answer.copy(deep=True)
        answer["error"].values[:] = wrong
        assert not task.certify(answer, 1e-6).holds
