"""The gain control of the drives."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.control.gain_control.problem import GRID, gain_control
from workbench.plants.cd_drive.control.gain_control.runs import (
    ARMS,
    WITHIN,
    crossover_of,
    level_of,
    started,
)
from workbench.plants.cd_drive.drive.plants import crossover
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench import solve
from workbench.solvers import Options


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_nominal_loop_crosses_at_the_wobble(axis):
    """By the continuous loop's crossover, which knows nothing of samples."""
    bench = Laboratory(axis, "nominal")
    assert level_of(bench) == pytest.approx(0.0, abs=0.1)
    assert crossover_of(bench, 0.0, GRID) == pytest.approx(crossover(axis), rel=0.02)


def test_a_larger_gain_crosses_later_and_none_not_at_all():
    bench = Laboratory("focus", "CD3")
    assert crossover_of(bench, 3.0, GRID) > crossover_of(bench, 0.0, GRID)
    assert np.isnan(crossover_of(bench, 60.0, GRID))


@pytest.mark.cases(0)
def test_a_start_sets_the_gain_of_a_drive_that_has_too_much():
    bench = Laboratory("focus", "CD8")
    start = started(bench, ARMS["ordinary"], 3)
    assert start.level[0] == pytest.approx(level_of(bench)) and start.level[0] > 2 * WITHIN
    assert abs(start.level[-1]) < 0.5 and 0.0 < start.settled < 1.0 and start.events == 0


def test_without_noise_it_is_exact():
    bench = replace(Laboratory("radial", "CD9"), noise=0.0, electronics=0.0, bits=None)
    assert started(bench, ARMS["still"], 0).level[-1] == pytest.approx(0.0, abs=0.05)


@pytest.fixture(scope="module")
def solved():
    task = gain_control("focus", draws=1)
    return task, solve(task, options=Options(seed=1))


@pytest.mark.slow
def test_the_run_is_stored_and_shown(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    stored = task.from_dataset(task.to_dataset(solution.answer))
    assert set(task.figures(stored)) == {"levels", "spread"}
    assert task.tables(stored)["spread"].count("\n") == 2 + 1 + len(ARMS)


@pytest.mark.slow
def test_gains_that_stay_apart_are_noticed(solved):
    task, solution = solved
    answer = solution.answer
    apart = answer.assign(after=answer["after"] + answer["before"])
    failing = " ".join(task.certify(apart, 1e-6).failures)
    assert "differences are removed" in failing and "gain is set" in failing
    never = answer.assign(settled=np.nan * answer["settled"])
    assert any("in time" in one for one in task.certify(never, 1e-6).failures)


@pytest.mark.slow
def test_another_seed_changes_no_verdict():
    task = gain_control("radial", draws=1)
    for seed in (0, 2):
        assert solve(task, options=Options(seed=seed)).certificate.holds
