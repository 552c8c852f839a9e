"""Steps, sines, noise and four estimators on a coil, over draws."""

import warnings
from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.response_methods.estimators import ESTIMATORS
from workbench.plants.cd_drive.laboratory.response_methods.excitations import (
    EXCITATIONS,
    RESPONSES,
    Excited,
)
from workbench.plants.cd_drive.laboratory.response_methods.problem import ResponseMethods, rms

from workbench import Options, solve
from workbench.identification import IdentificationWarning

DRAWS = 2


def study(axis="focus", drive="CD3", draws=DRAWS):
    return ResponseMethods(Excited(Laboratory(axis, drive), 0.1, 30.0), draws)


@pytest.fixture(scope="module")
def solved():
    program = study()
    return program, solve(program, options=Options(seed=7))


@pytest.mark.slow
def test_all_that_is_checked_holds(solved):
    program, solution = solved
    assert solution.certificate.failures == ()
    metrics = program.metrics(solution.answer)
    assert metrics["error_quiet_sines_mean"] < 1e-3 < metrics["error_quiet_spectra_half_s_mean"]
    assert metrics["error_noisy_step_least_squares_b"] > 0.3
    assert metrics["error_noisy_step_instruments_b"] < 0.15
    assert metrics["nearer_noisy_sines_than_step"] == 1.0


def test_excitations_last_equally_long_and_reach_the_same_voltage():
    excited = study("radial").excited
    played = excited.played
    assert {name: abs(one.u).max() for name, one in played.items()} == pytest.approx(
        dict.fromkeys(EXCITATIONS, 0.1), rel=1e-4
    )
    lengths = [len(one.u) for one in played.values()]
    assert max(lengths) - min(lengths) < len(excited.frequency)
    assert 0.4 < excited.waiting < 0.8


@pytest.mark.cases(0)
def test_without_noise_only_spectra_and_what_still_rings_are_off():
    excited = Excited(Laboratory("focus", "CD3", electronics=0.0, bits=None), 0.1, 30.0)
    truth = excited.sweep.exact()
    errors = {}
    for name in ("step", "sines"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", IdentificationWarning)  # of the last of the ringing
            found = excited.responses(name, excited.record(name, 0.0, 0))[name]
        errors[name] = np.max(abs(found.response[:, 0, 0] / truth - 1))
    assert max(errors.values()) < 2e-3


@pytest.mark.slow  # of its simulations and of the reports of 16 long records
def test_the_run_is_stored_and_shown(solved):
    program, solution = solved
    stored = program.from_dataset(program.to_dataset(solution.answer))
    assert all(check.holds for check in program.checks(stored, 1e-6))
    tables = program.tables(stored)
    assert tables["responses"].count("\n") == 2 + 2 * len(RESPONSES)
    assert tables["models"].count("\n") == 2 + 2 * len(EXCITATIONS) * len(ESTIMATORS)
    assert program.figures(stored).keys() == {"responses", "errors"}


@pytest.mark.slow  # of its simulations and of the reports of 16 long records
def test_wrong_answers_fail_their_checks(solved):
    program, solution = solved
    answer = solution.answer

    def failed(**changed):
        checks = program.checks(answer.assign(changed), 1e-6)
        return {check.name for check in checks if not check.holds}

    assert failed(error=answer["error"] + 0.02) == {"step", "sines", "spectra_4s"}
    assert "regions" in failed(missed=np.ones_like(answer["missed"]) + 0 * answer["missed"])
    swapped = answer["fit_error"].copy()
    swapped.loc[{"estimator": "instruments"}] = 10.0
    assert failed(fit_error=swapped) == {
        "prediction errors", *(f"instruments, {name}" for name in EXCITATIONS)
    }  # fmt: skip


def test_draws_of_drives_are_independent():
    seeds = [
        vars(ResponseMethods)["seed"].function(
            study(drive=drive), SimpleNamespace(rng=np.random.default_rng(0))
        )
        for drive in ("CD1", "CD2")
    ]
    assert len(np.unique(seeds)) == 2 * 2 * DRAWS


@pytest.mark.slow  # of its simulations and of the reports of 16 long records
def test_the_size_of_errors_is_over_the_frequencies(solved):
    error = solved[1].answer["error"]
    assert rms(error).dims == ("noise", "draw", "response")
    assert rms(0 * error + 0.5).max() == pytest.approx(0.5)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_another_seed_changes_no_verdict(axis):
    program = study(axis, draws=6)
    for seed in (0, 1):
        assert solve(program, options=Options(seed=seed)).certificate.holds
