"""The controller of a running loop is changed."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.photo_diodes import CAPTURE
from workbench.plants.cd_drive.operation.controller_change.problem import QUIET, ControllerChange
from workbench.plants.cd_drive.operation.controller_change.runs import (
    PERIOD,
    Change,
    linear_step,
    simulated_step,
    taken_at,
)

from workbench import solve
from workbench.simulation import play
from workbench.solvers import Options


def test_the_new_controller_is_taken_at_its_sample():
    told = play(taken_at(3 * PERIOD), np.zeros((5, 1)))[:, 0]
    assert told.tolist() == [0.0, 0.0, 0.0, 1.0, 1.0]


def test_a_change_is_at_its_angle_after_the_loop_has_settled():
    change = Change("focus", -3.0, 0.1)
    for angle in (0.0, 0.3, 0.9):
        assert (6.0 * change.time(angle)) % 1.0 == pytest.approx(angle, abs=1e-3)
        assert 0.35 <= change.time(angle) < 0.35 + 1 / 6.0


def test_a_change_to_itself_does_nothing():
    """In parallel the same controller has the same command."""
    one = Change("radial", 0.0, 1.0).changed("in parallel", "CD3", 0.25, 1, **QUIET)
    assert one.difference == 0.0 and not one.lost and one.largest < 1.05 * one.before


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_small_steps_are_those_of_the_linear_loop(axis):
    found = simulated_step(axis, "CD7", 0.05, 0, **QUIET) / 0.05
    assert found == pytest.approx(linear_step(axis, "CD7"), rel=0.01)


def test_a_step_that_loses_the_track_leaves_the_focus():
    assert simulated_step("radial", "CD1", 2.0, 1) > 10 * CAPTURE["radial"]
    assert simulated_step("focus", "CD1", 2.0, 1) < CAPTURE["focus"] / 2


def test_the_radial_loop_stands_a_change_without_a_bump_alone():
    change = Change("radial", -3.0, 1.0)
    parallel, bumpless = (
        change.changed(way, "CD1", 0.25, 1) for way in ("in parallel", "without a bump")
    )
    assert parallel.lost and not bumpless.lost
    assert bumpless.largest < CAPTURE["radial"] / 2


@pytest.mark.slow
@pytest.mark.cases(0)
def test_study():
    """Another seed changes no verdict."""
    task = ControllerChange("radial", -3.0, 1)
    for seed in (0, 1):
        solution = solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        numbers = task.metrics(solution.answer)
        assert numbers["lost_in_parallel_share_1_low"] > 0.2 > numbers["lost_without_a_bump_high"]
    wrong = solution.answer.copy(deep=True)
    wrong["lost"][...] = 1.0
    wrong["largest"].loc[{"way": "without a bump"}] = 1e-3
    wrong["per_volt"][...] *= 1.1
    failed = {one.name for one in task.certify(wrong, 1e-6).checks if not one.holds}
    assert failed == {"without a bump", "less error", "linear"}
