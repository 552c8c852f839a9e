"""Open-loop identification against what is known of the drive."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.drive.two_masses import lumped
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.open_loop import PARAMETERS, OpenLoop, without_transient

from workbench import Options, solve

COARSE = 1.0


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    program = OpenLoop(Laboratory(request.param, "CD5"), COARSE, 1.0)
    return program, solve(program, options=Options(seed=7))


def test_the_parameters_come_back(solved):
    program, solution = solved
    assert solution.certificate.failures == ()
    metrics = program.metrics(solution.answer)
    assert max(metrics[f"error_{name}"] for name in ["R", "Bl", "k"]) < 1e-3
    assert metrics["error_b"] < 5e-3


def test_the_lumped_damper_is_not_the_sum(solved):
    program, solution = solved
    parameters = program.laboratory.parameters
    fitted = solution.answer["truth"].sel(parameter="b").item()
    assert fitted == pytest.approx(lumped(parameters).b, rel=1e-2)
    assert fitted < 0.9 * (parameters.b1 + parameters.b2)


def test_the_run_is_stored_and_shown(solved):
    program, solution = solved
    assert program.figures(solution.answer).keys() == {"bode"}
    assert "b [N s/m]" in program.tables(solution.answer)["parameters"]
    checks = program.checks(program.from_dataset(program.to_dataset(solution.answer)), 1e-6)
    assert all(check.holds for check in checks)


def test_a_wrong_answer_fails_its_checks():
    program = OpenLoop(Laboratory("focus", "CD1"), COARSE, 1.0)
    answer = solve(program).answer
    assert program.metrics(answer)["chi_square"] == pytest.approx(1.0, abs=0.5)
    spoiled = answer.assign(truth=answer["truth"] * 1.1)
    assert not all(check.holds for check in program.checks(spoiled, 1e-6))


def test_transients_are_taken_out():
    frequency, pole = np.array([25.0, 30.0]), -9.4 + 190j
    periods = np.arange(20)
    ringing = 0.1 * np.exp((pole / frequency - 2j * np.pi)[:, None] * periods)
    cleaned = without_transient(1.0 + 0.5j + ringing, frequency, pole, 10)
    np.testing.assert_allclose(cleaned[:, 10:], 1.0 + 0.5j, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_intervals_cover_over_twelve_drives(axis):
    covered = []
    for seed, drive in enumerate(drives(axis)):
        program = OpenLoop(Laboratory(axis, drive.name), 0.1, 1.0)
        solution = solve(program, options=Options(seed=seed))
        assert solution.certificate.holds, drive.name
        covered.append(program.metrics(solution.answer)["covered"])
    assert np.mean(covered) >= 0.95
    assert len(covered) * len(PARAMETERS) == 48
