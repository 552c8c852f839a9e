"""Accuracy of both experiments over their settings, against formulas and the stored run."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.coil_current import CoilExperiment
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.experiment_settings import (
    FREQUENCY,
    PARAMETERS,
    RESISTORS,
    SETTINGS,
    ExperimentSettings,
    Setting,
    errors,
    experiment,
    measured,
    response_errors,
)
from workbench.plants.cd_drive.laboratory.in_the_loop import PERIODS, excitation

import workbench as wb
from workbench.errors import InputError


@pytest.mark.parametrize("resistance", RESISTORS)
def test_the_coil_obeys_equation_4_17(resistance):
    """A step of u ends at r / (R + r) of the coil's voltage, where the lens stands. Until then the
    back-EMF takes Bl x away, with k x = Bl i.
    """
    bench = Laboratory("focus", "CD1")
    p = bench.parameters
    k, total = p.k1 * p.k2 / (p.k1 + p.k2), p.R + resistance
    v_r, u_m = bench.coil_signals(np.ones(round(2.0 * RATE)), resistance).exact.T
    v_r, u_m = v_r / (bench.coil_gain * u_m[-1]), u_m / u_m[-1]  # the converter rounds u
    assert v_r[-1] == pytest.approx(resistance / total, rel=1e-5)
    taken = (u_m * resistance / total - v_r).sum() / RATE
    assert taken == pytest.approx(resistance * p.Bl**2 / (k * total**2), rel=1e-3)


@pytest.mark.parametrize("resistance", RESISTORS)
def test_a_fit_finds_the_lumped_drive(resistance):
    one = CoilExperiment(Laboratory("focus", "CD2"), 2.0, 1.0, series_resistance=resistance)
    response, variance, saturated = measured(one, 0)
    assert saturated == 0.0
    off = dict(zip(PARAMETERS, errors(one, response, variance), strict=True))
    assert off["k"] == pytest.approx(0.0, abs=2e-3)
    assert off["Bl"] == pytest.approx(0.0, abs=5e-3)
    assert off["b"] == pytest.approx(0.0, abs=2e-2)


def test_only_one_setting_differs_from_the_usual():
    usual = vars(Setting())
    for name, one in SETTINGS.items():
        changed = [key for key, value in vars(one).items() if value != usual[key]]
        assert len(changed) == (name != "usual")


def test_the_excitation_is_the_same_for_all_gains():
    bench = Laboratory("radial", "CD3")
    sine = excitation("radial", FREQUENCY)
    for name in ("usual", "less gain", "more gain"):
        played = experiment(bench, sine, SETTINGS[name]).signal
        np.testing.assert_array_equal(played, experiment(bench, sine, Setting()).signal)
    assert (experiment(bench, sine, SETTINGS["four times the periods"]).sine.periods
            == 4 * PERIODS).all()  # fmt: skip


def test_without_noise_the_response_is_exact():
    bench = replace(Laboratory("focus", "CD1"), noise=0.0, electronics=0.0, bits=None)
    one = experiment(bench, excitation("focus", FREQUENCY), Setting())
    assert max(response_errors(one, 0)) < 0.02


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_stored_certificate_holds_and_wrong_answers_are_rejected(reference, axis):
    run = reference(f"cd/{axis}/experiment-settings")
    study, answer = run.task, run.data.load()
    assert study.certify(run.answer, 1e-6).holds
    assert set(study.figures(run.answer)) == {"settings"}
    for name, factor in (("off", 10.0), ("damping", 0.99), ("saturated", None)):
        wrong = answer[name] * factor if factor else answer[name] + 0.1
        assert not study.certify(answer.assign({name: wrong}), 1e-6).holds, name


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_noise_averages_as_it_should(reference, axis):
    """Below the crossover: an error over the size, and over the root of the periods."""
    error = reference(f"cd/{axis}/experiment-settings").data["error"].sel(band="low").mean("draw")
    usual = float(error.sel(setting="usual"))
    assert float(error.sel(setting="half the size")) / usual == pytest.approx(2.0, rel=0.2)
    assert float(error.sel(setting="four times the periods")) / usual == pytest.approx(0.5, rel=0.2)


def test_an_unknown_drive_is_named():
    solution = wb.solve(wb.load("cd/focus/experiment-settings", drive="CD13", draws=2))
    assert "drive is 'CD13'; it must be" in solution.message


def test_few_draws_are_refused():
    with pytest.raises(InputError, match="draws"):
        wb.load("cd/focus/experiment-settings", draws=1)


def test_the_study_says_for_what_it_holds():
    study = ExperimentSettings(Laboratory("focus", "CD1"), 3)
    assert study.quantifier == "for this one drive, in 3 simulated draws"
