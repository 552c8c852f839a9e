"""The speed of mu: a small one, whose arithmetic must be right whatever the clock says."""

import numpy as np
import pytest
from workbench.plants.bench.mu import LEAST_RATIO, PEERS, MuSpeed, random_system, smooth_responses

import workbench as wb


@pytest.fixture(scope="module")
def solved():
    study = MuSpeed(frequencies=10, peers=2, most=10, largest=4)
    return study, wb.solve(study)


@pytest.mark.slow
def test_every_peer_was_timed_on_the_same_matrices(solved):
    study, solution = solved
    assert solution.answer is not None, solution.message
    assert list(solution.answer["by"].values) == ["fast", *PEERS]
    assert (solution.answer["seconds"] > 0).all()
    seconds = solution.answer["seconds"].sel(size=4)
    numbers = study.metrics(solution.answer)
    assert numbers["clarabel_4"] == pytest.approx(
        float(seconds.sel(by="clarabel") / seconds.sel(by="fast"))
    )


@pytest.mark.slow
def test_the_bound_is_never_above_a_peers(solved):
    """The checks that no clock decides hold, and the others have their limits."""
    study, solution = solved
    checks = {check.name: check for check in study.checks(solution.answer, 1e-6)}
    for name in PEERS:
        assert checks[f"never above {name}"].holds, checks[f"never above {name}"]
    assert checks["clarabel at size 4"].limit == 1 / LEAST_RATIO["clarabel"][4]


@pytest.mark.slow
def test_tables_have_a_row_for_each_size_and_count(solved):
    study, solution = solved
    tables = study.tables(solution.answer)
    assert tables["sizes"].count("\n") == 2 + 2
    assert "10 |" in tables["frequencies"]


def test_the_responses_are_those_of_a_stable_system():
    rng = np.random.default_rng(1)
    system = random_system(np.random.default_rng(1), 3, 6)
    assert system.poles().real.max() == pytest.approx(-0.1)
    direct = np.moveaxis(system(1j * np.logspace(-2, 2, 7)), -1, 0)
    np.testing.assert_allclose(smooth_responses(rng, 3, 7), direct, rtol=1e-9)
