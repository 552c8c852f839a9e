"""The sensitivity that an experiment in the laboratory measures, beside that of models."""

import numpy as np
import pytest
from workbench.plants.cd_drive.control.measured_sensitivity.experiment import (
    continuous_sensitivity,
    experiment_on,
    measured,
    sampled_sensitivity,
)
from workbench.plants.cd_drive.control.measured_sensitivity.problem import measured_sensitivity
from workbench.plants.cd_drive.laboratory.in_the_loop import LoopExperiment
from workbench.plants.cd_drive.laboratory.unknowns import TRUTH, Told

from workbench import solve
from workbench.solvers import Options

GRID = np.array([150.0, 400.0, 700.0, 1500.0, 4000.0])


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_without_noise_the_sensitivity_of_the_sampled_loop_is_measured(axis):
    """The reference is the model of the loop, which the experiment does not use."""
    noisy = experiment_on(axis, "CD5", GRID, 0.0, 1.0)
    bench = noisy.bench.__class__(axis, "CD5", noise=0.0, electronics=0.0, bits=None)
    quiet = LoopExperiment(bench, GRID, False)
    record = quiet.played(0)
    S = measured(quiet, 0).S
    # The s-curve of the diodes is straight in focus, a sine in radial.
    np.testing.assert_allclose(
        S, sampled_sensitivity(quiet), rtol=2e-3 if axis == "focus" else 2e-2
    )
    assert not record.events


def test_what_is_told_changes_the_model_but_not_the_measurement():
    experiment = experiment_on("focus", "CD5", GRID, 0.2, 1.0)
    exact = sampled_sensitivity(experiment)
    np.testing.assert_allclose(sampled_sensitivity(experiment, TRUTH), exact)
    gain = sampled_sensitivity(experiment, Told(gain=1.1))
    # 1/S - 1 is the loop transfer function, to which the told gain is a factor.
    np.testing.assert_allclose(1 / gain - 1, 1.1 * (1 / exact - 1))


def test_the_continuous_loop_has_the_sampled_ones_low_frequencies():
    experiment = experiment_on("focus", "CD5", GRID, 0.2, 1 / 3)
    continuous = continuous_sensitivity("focus", "CD5", GRID, 1 / 3)
    off = 20 * np.log10(abs(sampled_sensitivity(experiment)) / continuous)
    assert abs(off[0]) < 1.0 and abs(off).max() > 0.2


@pytest.fixture(scope="module")
def solved():
    task = measured_sensitivity("focus", frequencies=8, draws=1)
    return task, solve(task, options=Options(seed=1))


@pytest.mark.slow
def test_the_run_is_stored_and_shown(solved):
    task, solution = solved
    assert solution.certificate.holds, solution.certificate
    stored = task.from_dataset(task.to_dataset(solution.answer))
    assert set(task.figures(stored)) == {"figure-6-6", "good-from"}
    assert task.tables(stored)["comparison"].count("\n") == 6
    metrics = task.metrics(stored)
    assert metrics["good_30_percent_from_hz_third_ordinary_mean"] < 200.0


@pytest.mark.slow
def test_a_measurement_that_is_off_is_not_similar(solved):
    task, solution = solved
    wrong = solution.answer.assign(rms=solution.answer["rms"] + 1.0)
    failing = task.certify(wrong, 1e-6).failures
    assert any("similar" in one for one in failing)
    lost = solution.answer.assign(events=solution.answer["events"] + 1)
    assert any("loop holds" in one for one in task.certify(lost, 1e-6).failures)
    unknown = solution.answer.assign(most=np.nan * solution.answer["most"])
    assert any("similar" in one for one in task.certify(unknown, 1e-6).failures)


@pytest.mark.slow
def test_another_seed_changes_no_verdict():
    task = measured_sensitivity("radial", frequencies=8, draws=1)
    for seed in (0, 2):
        assert solve(task, options=Options(seed=seed)).certificate.holds
