"""Two tests of linearity in the loop, against what they measure without noise."""

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.linearity import LARGEST_DISPLACEMENT, displacement
from workbench.plants.cd_drive.laboratory.multisine_linearity.problem import (
    MultisineLinearity,
    both,
    time_for,
)
from workbench.plants.cd_drive.laboratory.multisine_linearity.runs import (
    LENGTHS,
    SAMPLES,
    SIZES,
    DistortionTests,
)

from workbench import Options, solve

DRAWS = 4


def study(axis, draws=DRAWS, drive="CD1"):
    return MultisineLinearity(DistortionTests(Laboratory(axis, drive)), draws)


@pytest.fixture(scope="module")
def solved():
    program = study("radial")
    return program, solve(program, options=Options(seed=5))


@pytest.mark.cases(0)
def test_all_that_is_checked_holds(solved):
    program, solution = solved
    assert solution.certificate.failures == ()
    metrics = program.metrics(solution.answer)
    assert metrics["odd_multisine_percent"] == pytest.approx(1.6, abs=0.4)
    assert metrics["odd_sines_100_percent"] == pytest.approx(0.87, abs=0.1)
    assert metrics["time_ratio_relative_low"] <= metrics["time_ratio_relative_high"]


def test_the_sines_distort_by_the_square_of_their_size():
    """The error is the sine of a position: its third harmonic grows with about the third power."""
    odd = [both(one)[0][0] ** 0.5 for one in study("radial").tests.sines_truth()]
    np.testing.assert_allclose(np.array(odd) / odd[-1], np.square(SIZES), rtol=0.15)


def test_the_multisine_moves_the_lens_as_far_as_allowed():
    tests = study("focus").tests
    design, excited = tests.multisine(np.random.default_rng(0))
    moved = displacement("focus", excited * 35e3 / SAMPLES)
    spectrum = design.amplitudes * np.exp(1j * design.phases) * moved
    turns = np.exp(2j * np.pi * np.outer(np.arange(SAMPLES) / SAMPLES, excited))
    lens = (turns @ spectrum).real
    assert abs(lens).max() == pytest.approx(LARGEST_DISPLACEMENT["focus"])
    assert np.all(excited % 2 == 1) and excited[0] >= 5 and excited[-1] <= 79


def test_focus_has_nothing_to_find():
    program = study("focus")
    assert both(program.tests.multisine_truth(3))[0] == pytest.approx((0.0, 0.0), abs=1e-12)
    levels = [both(one)[0][0] for one in program.tests.sines_truth()]
    assert max(abs(np.array(levels))) < 1e-9


@pytest.mark.cases(0)
def test_the_run_is_stored_and_shown(solved):
    program, solution = solved
    stored = program.from_dataset(program.to_dataset(solution.answer))
    assert all(check.holds for check in program.checks(stored, 1e-6))
    assert program.figures(stored).keys() == {"tests"}
    assert program.tables(stored)["linearity"].count("\n") == 2 + len(LENGTHS) + 4


def test_wrong_answers_fail_their_checks(solved):
    program, solution = solved
    answer = solution.answer

    def failed(**changed):
        checks = program.checks(answer.assign(changed), 1e-6)
        return {check.name for check in checks if not check.holds}

    assert failed(sines_truth=answer["sines_truth"] + 0.1) == {"even", "bias"}
    assert failed(by_multisine_p=0 * answer["by_multisine_p"]) == {"false alarms"}


def test_time_for_an_error_follows_the_power_law():
    times = np.array([1.0, 2.0, 4.0])
    errors = np.array([3.0 / times, 8.0 / times**2])
    np.testing.assert_allclose(time_for(np.array([1.5, 0.5]), errors, times), [2.0, 4.0])
    np.testing.assert_allclose(time_for(np.array([0.3]), errors[:1], times), [10.0])


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_another_seed_changes_no_verdict(axis):
    for seed in (0, 1):
        assert solve(study(axis, draws=12), options=Options(seed=seed)).certificate.holds
