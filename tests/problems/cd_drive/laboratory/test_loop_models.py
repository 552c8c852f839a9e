"""The plant of the focus loop by each method for closed loops."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD, RATE
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.in_the_loop import ERROR_SWING, controller_response
from workbench.plants.cd_drive.laboratory.loop_models.excitation import (
    BAND,
    LARGEST_INPUT,
    SAMPLES,
    MultisineExperiment,
    sampled_controller,
    signals,
)
from workbench.plants.cd_drive.laboratory.loop_models.identification import (
    ASSUMED,
    CLOSED,
    USUAL,
    loop_model,
)
from workbench.plants.cd_drive.laboratory.loop_models.problem import (
    JUDGED,
    LIMIT,
    LoopModels,
    loop_models,
)

from workbench import Options, load, solve


@pytest.fixture(scope="module")
def experiment():
    return MultisineExperiment(Laboratory("focus", "CD1"), 50)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_multisine_reaches_a_limit_in_the_nominal_loop(axis):
    quiet = Laboratory(axis, "nominal", noise=0.0, electronics=0.0, bits=None)
    excitation, record = MultisineExperiment(quiet, 2).played(0)
    last = slice(-SAMPLES, None)
    moved = record.x - record.x_cd
    swing = np.ptp(moved[last] - np.mean(moved[last])) / 2 / ERROR_SWING[axis]
    driven = max(abs(one[last]).max() for one in (excitation, record.u)) / LARGEST_INPUT
    assert max(swing, driven) == pytest.approx(1.0, abs=0.25)  # the disc turns, too
    assert driven < 1.25 and swing < 1.25


def test_signals_at_a_lower_rate_have_the_response_of_the_plant():
    """No filter against aliasing is needed: without noise the lines tell the plant exactly."""
    quiet = Laboratory("focus", "CD1", noise=0.0, electronics=0.0, bits=None)
    experiment = MultisineExperiment(quiet, 4)
    taken = signals(*experiment.played(0), USUAL)
    lines = experiment.multisine.lines
    U, Y = (np.fft.rfft(one[-taken.period :])[lines] for one in (taken.u, taken.y))
    exact = quiet.response(lines * RATE / SAMPLES)["f_en"]
    inner = lines * RATE / SAMPLES > 2 * BAND[0]
    np.testing.assert_allclose((Y / U)[inner], exact[inner], rtol=0.02)


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_controller_at_a_lower_rate_acts_as_the_known_one(axis):
    law = sampled_controller(axis, USUAL)
    frequency = np.array([150.0, 600.0, 1800.0, 3300.0])
    z = np.exp(2j * np.pi * frequency * USUAL * PERIOD)
    found = law(z, squeeze=False)[0, 0]
    np.testing.assert_allclose(found, -controller_response(axis, frequency), rtol=1e-3)


@pytest.mark.slow
def test_instruments_find_the_plant(experiment):
    """Also in another draw of the noise."""
    taken = signals(*experiment.played(7), USUAL)
    model = loop_model("instrumental-variables", taken, None, JUDGED, Options())
    exact = experiment.bench.response(JUDGED)["f_en"]
    assert np.sqrt(np.mean(abs(model.response / exact - 1) ** 2)) < LIMIT
    assert model.failures == 0
    assert np.median(abs(model.response - exact) / model.deviation) < 2


@pytest.mark.slow
def test_every_method_is_close_and_wrong_answers_fail():
    program = load("cd/focus/loop-models")
    assert isinstance(program, LoopModels)
    solution = solve(program)
    assert solution.certificate.valid, solution.certificate.failures
    answer, metrics = solution.answer, program.metrics(solution.answer)
    assert metrics["worst_error"] < LIMIT < metrics["error_open_loop"]
    assert metrics["pulled_open_loop"] > 3 * max(
        abs(metrics[f"pulled_{name.replace('-', '_')}"]) for name in CLOSED
    )
    (figure,) = program.figures(answer).values()
    assert all(panel.get_ylabel().endswith("]") for panel in figure.axes)
    (table,) = program.tables(answer).values()
    assert all(name in table for name in ASSUMED)

    def failed(**changed):
        checks = program.checks(answer.assign(changed), 1e-6)
        return {check.name for check in checks if not check.holds}

    assert failed(error=0 * answer["error"] + LIMIT / 2) == {"open loop"}
    assert failed(error=answer["error"] + LIMIT) == set(CLOSED)
    assert failed(events=answer["events"] + 1) == {"loop"}
    assert failed(unproven=answer["unproven"] + 1) == {"models"}
    assert failed(saturated=answer["saturated"] + 1e-6) == {"saturation"}
    assert failed(largest_error=3 * answer["largest_error"]) == {"linear range"}


def test_a_drive_may_be_chosen():
    program = loop_models("focus", "CD3", periods=20)
    assert program.quantifier == "for one simulated record of CD3"
    assert replace(program.experiment, periods=30).periods == 30
    assert loop_models("radial").experiment.periods == 2 * loop_models("focus").experiment.periods


@pytest.mark.slow
def test_the_radial_plant_is_found_without_a_model_of_the_noise():
    program = load("cd/radial/loop-models")
    solution = solve(program)
    assert solution.certificate.valid, solution.certificate.failures
    metrics = program.metrics(solution.answer)
    assert metrics["worst_error"] < LIMIT < metrics["error_direct"]
