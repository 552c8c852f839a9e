"""Unlike arms: resonances, orders, and intervals of models of too low an order."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.actuator import SERIES_RESISTANCE, specific_model
from workbench.plants.cd_drive.drive.two_masses import lens, lens_on_arms, mismatch_names
from workbench.plants.cd_drive.laboratory.bench_setup import find_drive, split_arms
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.unlike_arms.problem import (
    FINE,
    MISMATCH,
    unlike_arms,
)
from workbench.plants.cd_drive.laboratory.unlike_arms.resonances import (
    LARGEST_MISMATCH,
    order_of,
    random_mismatches,
    resonances_shown,
)

from workbench import solve
from workbench.errors import InputError
from workbench.solvers import Options

DRIVE = find_drive("focus", "CD12")
FOUR = (0.3, 0.2, -0.2, -0.3)


@pytest.mark.parametrize("mismatch", [(0.2, -0.2), FOUR])
def test_the_fitted_model_is_that_of_the_bench(mismatch):
    """The bench assembles matrices, the fit a quotient of impedances."""
    p = vars(DRIVE) | dict(zip(mismatch_names(len(mismatch)), mismatch, strict=False))
    model = lens_on_arms(p, 2j * np.pi * FINE, DRIVE.R + SERIES_RESISTANCE, len(mismatch))
    np.testing.assert_allclose(model, split_arms(DRIVE, mismatch).response(FINE), rtol=1e-9)


def test_arms_that_are_alike_are_one():
    whole = specific_model(DRIVE).response(FINE)
    np.testing.assert_allclose(split_arms(DRIVE, (0.0,) * 4).response(FINE), whole, rtol=1e-9)
    alone = lens_on_arms(vars(DRIVE), 2j * np.pi * FINE, 20.0, 1)
    np.testing.assert_allclose(alone, lens(vars(DRIVE), 2j * np.pi * FINE, 20.0), rtol=1e-12)
    assert order_of(split_arms(DRIVE, (0.0,) * 4)) == 4
    assert Laboratory("focus", "CD12", mismatch=(0.0, 0.0)).arms_alike


@pytest.mark.parametrize(
    ("mismatch", "order"),
    [((0.2, -0.2), 6), ((0.2, 0.2, -0.2, -0.2), 6), ((0.3, 0.0, -0.3), 8), (FOUR, 10)],
)
def test_the_order_is_that_of_the_arms_that_differ(mismatch, order):
    assert order_of(split_arms(DRIVE, mismatch)) == order


def test_a_number_is_two_halves():
    halves = split_arms(DRIVE, 0.2).response(FINE)
    np.testing.assert_allclose(halves, split_arms(DRIVE, (0.2, -0.2)).response(FINE))


@pytest.mark.parametrize("mismatch", [(0.2, 0.2), (1.0, -1.0), (), (np.nan, 0.0), -0.1])
def test_wrong_mismatches_are_named(mismatch):
    with pytest.raises(InputError, match="mismatch"):
        split_arms(DRIVE, mismatch)


def test_peaks_are_counted():
    shape = sum(30.0 / (1 - (FINE / f) ** 2 + 0.05j * FINE / f) for f in (400.0, 700.0, 1200.0))
    assert resonances_shown(FINE, (100.0 + shape) / FINE**2) == 3
    assert resonances_shown(FINE, 1 / FINE**2) == 0


def test_random_arms():
    found = random_mismatches(np.random.default_rng(0), 0.5, 1000)
    assert abs(found.sum(axis=1)).max() < 1e-12 and abs(found).max() <= LARGEST_MISMATCH + 1e-12
    assert found.std() == pytest.approx(0.5 * np.sqrt(3 / 4), rel=0.1)


@pytest.fixture(scope="module")
def solved():
    task = unlike_arms("focus", step_hz=10.0, draws=3)
    return task, solve(task, options=Options(seed=3))


@pytest.mark.slow
def test_the_run_is_stored_and_shown(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    stored = task.from_dataset(task.to_dataset(solution.answer))
    assert set(task.figures(stored)) == {"figure-4-5", "resonances"}
    assert task.tables(stored)["fits"].count("\n") == 2 + 6
    metrics = task.metrics(stored)
    assert metrics["order_four"] == 2 * len(MISMATCH["four"]) + 2
    assert metrics["covered_m2_halves_4"] < metrics["covered_m2_halves_6"]


@pytest.mark.slow
def test_intervals_that_hold_or_miss_where_they_should_not_are_noticed(solved):
    task, solution = solved
    answer = solution.answer
    wide = answer.assign(half_width=abs(answer["table_value"]) + 0.0 * answer["half_width"])
    assert any("intervals of order 4" in one for one in task.certify(wide, 1e-6).failures)
    narrow = answer.assign(half_width=0.0 * answer["half_width"])
    assert any("coverage" in one for one in task.certify(narrow, 1e-6).failures)
    alike = answer.assign(shown=0 * answer["shown"] + 1)
    assert any("two resonances" in one for one in task.certify(alike, 1e-6).failures)


@pytest.mark.slow
def test_another_seed_changes_no_verdict():
    task = unlike_arms("radial", step_hz=5.0, draws=3)
    for seed in (0, 2):
        assert solve(task, options=Options(seed=seed)).certificate.holds
