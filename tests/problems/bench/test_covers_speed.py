"""The speed of covers: a small one, whose arithmetic must be right whatever the clock says."""

import numpy as np
import pytest
from workbench.plants.bench.covers import LARGE_OVER_CONIC, LEAST_RATIO, CoverSpeed
from workbench.plants.bench.scanned import ScannedStadiums

import workbench as wb
from workbench import Options
from workbench.executor import Context
from workbench.geometry import narrowest_stadium

TASKS = ["steps", "conic", "large, steps", "large, joint", "large, circles"]


@pytest.fixture(scope="module")
def solved():
    study = CoverSpeed(frequencies=10, plants=6, grid=16)
    return study, wb.solve(study)


@pytest.mark.slow
def test_the_times_and_the_peers_radii_are_there(solved):
    study, solution = solved
    assert solution.answer is not None, solution.message
    assert list(solution.answer["task"].values) == TASKS
    assert (solution.answer["seconds"] > 0).all()
    numbers = study.metrics(solution.answer)
    seconds = solution.answer["seconds"].values
    assert numbers["steps_over_conic"] == pytest.approx(seconds[1] / seconds[0])
    assert 0 < numbers["memory_gib"] < 16


@pytest.mark.slow
def test_the_peer_solves_the_same_problem(solved):
    """The checks that no clock decides hold, and the others have their limits."""
    study, solution = solved
    checks = {check.name: check for check in study.checks(solution.answer, 1e-6)}
    assert checks["peer near"].holds, checks["peer near"]
    assert checks["peer not below"].holds, checks["peer not below"]
    assert checks["steps over conic"].limit == 1 / LEAST_RATIO
    assert checks["large over conic"].limit == LARGE_OVER_CONIC


@pytest.mark.slow
def test_slowness_is_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["seconds"].loc[{"task": "conic"}] = float(answer["seconds"].sel(task="steps"))
    peer = float(answer["seconds"].sel(task="conic"))
    answer["seconds"].loc[{"task": "large, joint"}] = 2 * LARGE_OVER_CONIC * peer
    failed = {check.name for check in study.checks(answer, 1e-6) if not check.holds}
    assert {"steps over conic", "large over conic"} <= failed


@pytest.mark.slow
def test_the_run_is_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert study.figures(stored).keys() == {"ratios"}


@pytest.mark.cases(1)
@pytest.mark.parametrize("center", [None, 0.0])
def test_scanned_stadiums_are_nearly_the_narrowest(center):
    rng = np.random.default_rng(3)
    sets = rng.normal(size=(2, 7)) + 1j * rng.normal(size=(2, 7))
    context = Context(options=Options())
    radius, angle = ScannedStadiums(7, context).narrowest(sets, center, "test")
    exact = narrowest_stadium(sets, center=center)
    assert (radius >= exact.radius * (1 - 1e-6)).all()
    np.testing.assert_allclose(radius, exact.radius, rtol=0.02)
    assert ((angle >= 0) & (angle < np.pi)).all()
