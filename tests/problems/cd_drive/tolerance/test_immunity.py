"""How much gain defects allow: the crossing by hand, intervals, a small ensemble."""

import numpy as np
import pytest
from workbench.plants.cd_drive.tolerance.immunity import (
    GAINS,
    STRATEGIES,
    _crossing,
    _told,
    immunity,
)

from workbench import solve
from workbench.solvers import Options


@pytest.mark.parametrize(
    ("cost", "limit", "gain"),
    [
        ([1.0, 1.0, 1.0, 1.0, 1.0], 1.0, 8.0),
        ([0.0, 0.0, 1.0, 2.0, 3.0], 0.5, 3.0),
        ([2.0, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0),
        ([0.0, 2.0, 0.0, 0.0, 0.0], 1.0, 1.0),
    ],
)
def test_the_gain_at_which_a_cost_reaches_a_limit(cost, limit, gain):
    assert _crossing(np.array(cost), limit) == pytest.approx(gain)


def test_intervals_leave_out_samples_without_a_value():
    samples = np.array([[1.0], [0.0], [np.nan], [2.0]])
    found, low, high = _told(samples)[:, 0]
    assert found == 1.0
    assert 0.0 <= low < 1.0 < high <= 2.0


@pytest.fixture(scope="module")
def studies():
    task = immunity("focus", scenarios=14, drives=1, workers=1)
    return task, [solve(task, options=Options(seed=seed)) for seed in (3, 4)]


@pytest.mark.slow
def test_another_seed_changes_no_verdict(studies):
    _, solutions = studies
    for one in solutions:
        assert one.certificate.valid, one.certificate.failures
        allowed = one.answer["allowed"].sel(strategy=["B", "C"], told="found")
        assert (allowed > 4.0).all()
        assert (one.answer["shocks"].sel(told="found") <= 1.0).all()
    assert not solutions[0].answer["outside"].equals(solutions[1].answer["outside"])


@pytest.mark.slow
def test_checks_can_fail(studies):
    task, solutions = studies
    worse = solutions[0].answer.copy(deep=True)
    worse["outside"][0, 0, 0] = 1.1
    worse["sensitivity"][0] *= 1.01
    failed = {one.name for one in task.checks(worse, 1e-6) if not one.holds}
    assert failed == {"shares", "sensitivity"}


@pytest.mark.slow
def test_tables_and_figures(studies):
    task, solutions = studies
    table = task.tables(solutions[0].answer)["immunity"]
    assert all(name in table for name in STRATEGIES)
    assert set(task.figures(solutions[0].answer)) == {"immunity"}
    assert solutions[0].answer.sizes["gain"] == len(GAINS)
