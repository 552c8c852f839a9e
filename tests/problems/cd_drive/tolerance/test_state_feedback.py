"""State feedback on the estimates of strategy B: its gain, its loops, and what it refuses."""

import control
import numpy as np
import pytest
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.tolerance.state_feedback.law import (
    StateFeedback,
    crossover,
    estimated,
    loop,
    matched,
)
from workbench.plants.cd_drive.tolerance.state_feedback.problem import (
    CASES,
    StateFeedbackStudy,
    _growth,
    state_feedback,
)
from workbench.plants.cd_drive.tolerance.strategies.stability import estimated_decay
from workbench.plants.cd_drive.tolerance.tactics import Strategies

from workbench import solve
from workbench.errors import SolverError
from workbench.simulation import discrete_system
from workbench.solvers import Options

AXES = ("focus", "radial")


@pytest.mark.parametrize("axis", AXES)
def test_the_loop_of_b_decays_as_another_analysis_says(axis):
    K = discrete_system(control.ss(controller(axis)), PERIOD)
    for name in ("nominal", "CD8"):
        bench = Laboratory(axis, name)
        growth = _growth(loop(bench, estimated(axis, 5.5, K)))
        decay = estimated_decay(Strategies(axis, 1.0, 5.5), bench)
        assert growth == pytest.approx(-decay, rel=1e-6)


def test_the_gain_beats_its_neighbours():
    """Cost of a start from rest with the command on its way, by summing the closed loop's."""
    law = StateFeedback("focus", 5.5, 0.5)
    A, B, C = law._deviations
    best = law.gain * law.scale

    def cost(row):
        x, total = np.ones(len(A)), 0.0
        for _ in range(20_000):
            w = -row @ x
            total += float((C @ x)[0] ** 2 + law.weight * w**2)
            x = A @ x + B[:, 0] * w
        return total

    least = cost(best)
    rng = np.random.default_rng(0)
    for _ in range(4):
        assert cost(best * (1 + 0.05 * rng.standard_normal(len(best)))) > least
    assert law.residual < 1e-9


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", AXES)
def test_a_law_is_matched_and_stable_on_every_drive(axis):
    K = discrete_system(control.ss(controller(axis)), PERIOD)
    frequency = crossover(loop(Laboratory(axis, "nominal"), K))
    law = matched(axis, 5.5, frequency)
    assert crossover(law.target) == pytest.approx(frequency, rel=1e-4)
    for n in range(1, 13):
        assert _growth(loop(Laboratory(axis, f"CD{n}"), law.controller)) < 0.0


def test_a_bandwidth_out_of_reach_is_named():
    with pytest.raises(SolverError, match="no weight gives a crossover of 14000 Hz"):
        matched("focus", 5.5, 14_000.0)
    with pytest.raises(SolverError, match="no crossover"):
        crossover(control.ss([], [], [], [[0.5]], PERIOD))


@pytest.fixture(scope="module")
def studies():
    task = state_feedback("focus", drive_count=0, draws=2)
    return task, [solve(task, options=Options(seed=seed)) for seed in (1, 2)]


@pytest.mark.slow
def test_another_seed_changes_no_verdict(studies):
    task, solutions = studies
    verdicts = [
        {one.name: one.holds for one in task.checks(each.answer, 1e-6)} for each in solutions
    ]
    assert verdicts[0] == verdicts[1]
    assert all(verdicts[0].values())
    shares = [task.metrics(each.answer)["below_B_1.2mm"] for each in solutions]
    assert shares == [1.0, 1.0]


@pytest.mark.cases(0)
def test_draws_are_shared_and_checks_can_fail(studies):
    task, solutions = studies
    answer = solutions[0].answer
    again = task.outcomes(
        matched("focus", 5.5, task.reference_crossover), "nominal", int(answer["seed"][0, 1])
    )
    found = answer["excursion"].isel(drive=0, draw=1).values
    assert np.array(again)[..., 0] == pytest.approx(found)
    worse = answer.copy(deep=True)
    worse["growth"].loc[{"loop_of": "B"}] = 1.0
    worse["gain"][0] *= 1.01
    worse["events"].loc[{"case": "B"}] = 1
    failed = {one.name for one in task.checks(worse, 1e-6) if not one.holds}
    assert failed == {"stable B", "gain", "kept"}
    worse["weight"][()] *= 2.0
    assert "bandwidth" in {one.name for one in task.checks(worse, 1e-6) if not one.holds}


@pytest.mark.cases(0)
def test_figures_and_tables(studies):
    task, solutions = studies
    assert set(task.figures(solutions[0].answer)) == {"loops", "excursions"}
    tables = task.tables(solutions[0].answer)
    assert set(tables) == {"loops", "experiments"}
    assert all(name in tables["experiments"] for name in CASES)
    assert isinstance(task, StateFeedbackStudy)
