"""Open-loop identification over draws, against what is known of the drive."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.drive.two_masses import lumped
from workbench.plants.cd_drive.laboratory.coil_current import CoilExperiment, without_transient
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.open_loop import PARAMETERS, OpenLoop
from workbench.plants.cd_drive.laboratory.unknowns import MASS_DEVIATION, Told

from workbench import Options, solve

COARSE, DRAWS = 2.0, 6


def study(axis, drive="CD5", step=COARSE, draws=DRAWS):
    return OpenLoop(CoilExperiment(Laboratory(axis, drive), step, 1.0), draws)


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    program = study(request.param)
    return program, solve(program, options=Options(seed=7))


@pytest.mark.cases(0)
def test_the_parameters_come_back_at_the_mass_that_is_told(solved):
    program, solution = solved
    assert solution.certificate.failures == ()
    metrics = program.metrics(solution.answer)
    assert max(metrics[f"error_{name}_told_mass_high"] for name in ["R", "Bl", "k"]) < 1e-3
    assert metrics["error_b_told_mass_high"] < 1e-2


@pytest.mark.cases(1)
def test_the_mass_that_is_told_is_the_error(solved):
    """k and b are wrong as the mass is, Bl half as much; the intervals contain it."""
    program, solution = solved
    answer = solution.answer
    told = [Told.drawn(program.experiment.axis, int(seed)).mass for seed in answer["seed"]]
    ratio = answer["estimate"] / answer["truth"]
    np.testing.assert_allclose(ratio.sel(parameter="k"), told, rtol=3e-3)
    np.testing.assert_allclose(ratio.sel(parameter="b"), told, rtol=1e-2)
    np.testing.assert_allclose(ratio.sel(parameter="Bl"), np.sqrt(told), rtol=3e-3)
    wide = answer["half_width"].sel(parameter="k") / answer["estimate"].sel(parameter="k")
    np.testing.assert_allclose(wide, 2.576 * MASS_DEVIATION, rtol=1e-2)


def test_the_lumped_damper_is_not_the_sum(solved):
    program, solution = solved
    parameters = program.experiment.laboratory.parameters
    fitted = solution.answer["truth"].sel(parameter="b").item()
    assert fitted == pytest.approx(lumped(parameters).b, rel=1e-2)
    assert fitted < 0.9 * (parameters.b1 + parameters.b2)


def test_the_run_is_stored_and_shown(solved):
    program, solution = solved
    assert program.figures(solution.answer).keys() == {"bode"}
    table = program.tables(solution.answer)["parameters"]
    assert "b [N s/m]" in table and f"{DRAWS}/{DRAWS}" in table
    checks = program.checks(program.from_dataset(program.to_dataset(solution.answer)), 1e-6)
    assert all(check.holds for check in checks)


@pytest.mark.cases(0)
def test_another_seed_changes_no_verdict(solved):
    program, solution = solved
    other = solve(program, options=Options(seed=8))
    assert (other.answer["estimate"] != solution.answer["estimate"]).any()
    verdicts = [
        {check.name: check.holds for check in program.checks(one.answer, 1e-6)}
        for one in (solution, other)
    ]
    assert verdicts[0] == verdicts[1]


@pytest.mark.cases(0)
def test_draws_of_drives_are_independent():
    seeds = [
        solve(study("focus", drive, step=5.0, draws=2)).answer["seed"] for drive in ("CD1", "CD2")
    ]
    assert len(np.unique(seeds)) == 4


def test_wrong_answers_fail_their_checks(solved):
    program, solution = solved
    answer = solution.answer
    spoiled = answer.assign(truth=answer["truth"] * 1.1)
    failed = {check.name for check in program.checks(spoiled, 1e-6) if not check.holds}
    errors = {f"error of {name}" for name in PARAMETERS}
    assert failed == errors | {f"coverage of {name}" for name in ("R", "Bl", "k", "b")}
    narrow = answer.assign(half_width=answer["half_width"] / 20)
    failed = {check.name for check in program.checks(narrow, 1e-6) if not check.holds}
    assert {"coverage of k", "coverage of Bl"} <= failed


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
    for drive in drives(axis):
        program = study(axis, drive.name, step=0.5, draws=12)
        solution = solve(program)
        assert solution.certificate.holds, drive.name
        covered.append(program.metrics(solution.answer)["covered"])
    assert np.mean(covered) >= 0.98
    assert len(covered) * len(PARAMETERS) == 48
