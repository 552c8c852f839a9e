"""The position estimators' problem: its model against the laboratory, its numbers, its checks."""

from dataclasses import replace

import numpy as np
import pytest
from lanes import thinned
from workbench.plants.cd_drive.diagnosis.position_estimator.exact_gain import (
    PRINTED_POLES,
    exact_companion_gain,
)
from workbench.plants.cd_drive.diagnosis.position_estimator.model import (
    PRINTED_K_OBS,
    PRINTED_K_P,
    colour,
    companion_gain,
    kalman,
    model,
    of_prototype,
    thesis_estimator,
)
from workbench.plants.cd_drive.diagnosis.position_estimator.problem import position_estimator
from workbench.plants.cd_drive.diagnosis.position_estimator.study import (
    CASES,
    ESTIMATORS,
    RIVALS,
)
from workbench.plants.cd_drive.diagnosis.position_estimator.trials import (
    DIST_MAX,
    DIST_MIN,
    Scratches,
)
from workbench.plants.cd_drive.diagnosis.scratch_draws import ScratchDraw
from workbench.plants.cd_drive.laboratory.bench_setup import NOISE, PERIOD, RATE, find_drive
from workbench.plants.cd_drive.laboratory.experiment import Laboratory

from workbench import solve
from workbench.diagnosis import Rotation, prototype_poles
from workbench.simulation import band_limited_noise
from workbench.solvers import Options, Outcome

AXES = ("focus", "radial")
ROTATION = Rotation(5.5)


@pytest.fixture(scope="module")
def runs():
    """Study and solution by axis, each computed once."""
    found = {}

    def run(axis):
        if axis not in found:
            task = position_estimator(axis, draws=4)
            found[axis] = task, solve(task, options=Options(seed=5))
        return found[axis]

    return run


@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_model_is_the_laboratory_without_delay(axis):
    """u -> f_en of the model is minus that of the exact sampled drive."""
    bench, frequency = Laboratory(axis, "nominal", delay=0.0), np.array([5.5, 40.0, 600.0, 3e3])
    z = np.exp(2j * np.pi * frequency * PERIOD)
    plant = model(axis, ROTATION, coloured=False).plant
    exact = bench.response(frequency)
    response = plant(z)
    np.testing.assert_allclose(response[0, 0], exact["f_en"], rtol=1e-6)
    np.testing.assert_allclose(response[1, 0], -exact["x"], rtol=1e-6)
    np.testing.assert_allclose(response[:, 1], -response[:, 0], rtol=1e-9)


@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_colour_has_the_size_and_band_of_the_noise(axis):
    system = colour(axis)
    z = np.exp(2j * np.pi * np.linspace(-0.5, 0.5, 40_001))
    power = abs(system(z)) ** 2
    size = NOISE[axis] * find_drive(axis, "nominal").K_optn
    assert np.trapezoid(power, dx=1 / 40_000) ** 0.5 == pytest.approx(size, rel=1e-4)
    below = abs(np.linspace(-RATE / 2, RATE / 2, 40_001)) < 1750.0
    assert power[below].sum() > 0.75 * power.sum()
    rng = np.random.default_rng(0)
    assert band_limited_noise(rng, (20_000, 1), size, 1750.0, 1 / RATE).std() == pytest.approx(
        size, rel=0.05
    )


def test_equation_7_34():
    gain = companion_gain("focus")
    assert abs(gain / PRINTED_K_OBS - 1).max() < 0.13
    np.testing.assert_allclose(gain, exact_companion_gain("focus"), rtol=1e-4)


def test_equation_7_33():
    own = prototype_poles("itae", 5, 1.0)
    assert abs(own[:, None] - PRINTED_POLES).min(axis=0).max() < 1e-4


def test_equation_7_35_a_sample_settles_and_with_the_other_sign_does_not():
    thesis = thesis_estimator("focus", ROTATION)
    decay = -np.log(abs(thesis.poles()).max()) / PERIOD
    assert 30.0 < decay < 60.0
    A, C = thesis.model.A[:7, :7], thesis.model.C[:7]
    L = A @ thesis.gain
    np.testing.assert_allclose(abs(L[5:]), PRINTED_K_P)
    L[6] = -L[6]
    assert abs(np.linalg.eigvals(A - np.outer(L, C))).max() > 1.0 + 1e-4


@pytest.mark.parametrize("kind", ["itae", "bessel"])
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_estimators_have_the_poles_that_were_asked_for(axis, kind):
    found = np.log(of_prototype(kind, axis, ROTATION, 300.0).poles()) / PERIOD
    wanted = [*prototype_poles(kind, 5, 2 * np.pi * 300.0), -60 + 11j * np.pi, -60 - 11j * np.pi]
    assert abs(found[:, None] - np.array(wanted)).min(axis=0).max() < 0.1


def test_innovations_of_the_kalman_filter_have_the_size_that_it_states():
    """Innovations of a record without a scratch are no larger than it states, nor far smaller."""
    scratches = Scratches("focus", 1.2e-3, 0.0, 0.0, "printed")
    trial = scratches.trial("nominal", ScratchDraw(3, 0.25))
    filtering = kalman("focus", ROTATION)
    P, C = filtering.stationary_covariance, filtering.model.C[: filtering.model.seen]
    stated = (C @ P @ C + filtering.noise.measurement**2) ** 0.5
    x, A, B = np.zeros(13), filtering.model.A, filtering.model.B
    gain = np.concatenate([filtering.steady_state.gain, np.zeros(4)])
    innovations = []
    for y, u in zip(trial.record.f_en, trial.known, strict=True):
        innovations.append(y - filtering.model.C @ x)
        x = A @ (x + gain * innovations[-1]) + B * u
    size = np.std(innovations[20_000:])
    # Stated for drives that differ from the nominal one, and for noise without a sharp end.
    assert 0.2 * stated < size < stated


def test_quality_of_clean_and_covered_samples():
    trial = Scratches("focus", 1.2e-3, 0.8, 0.5, "printed").trial("CD3", ScratchDraw(1, 0.25))
    clean = Laboratory("focus", "CD3").parameters
    seen = trial.quality
    dist = abs(1.0 - trial.record.sum * clean.K_optn / clean.K_opt) / 2**0.5
    ramp = np.clip((DIST_MAX - dist) / (DIST_MAX - DIST_MIN), 0.0, 1.0)
    np.testing.assert_allclose(seen, ramp, atol=1e-12)
    assert (seen[trial.record.light == 1.0] == 1.0).all()
    assert (seen[trial.record.light < 0.3] == 0.0).all()
    assert 0 < ((seen > 0) & (seen < 1)).sum() < 100


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_study_holds(runs, axis):
    _, solution = runs(axis)
    assert solution.outcome is Outcome.SOLVED, solution.certificate.failures


@pytest.mark.cases(0)
def test_what_the_study_found(runs):
    task, solution = runs("focus")
    numbers = task.metrics(solution.answer)
    assert numbers["during_kalman_high_um"] < 0.5 < 1.2 < numbers["during_measured_low_um"]
    assert max(numbers["spike_kalman_high_um"], numbers["spike_itae_300_hz_high_um"]) < 0.6
    assert numbers["spike_itae_5_khz_mean_um"] > 10.0
    assert 1.0 < numbers["spike_thesis_prompt_without_noise_um"] < 6.0
    adapted, wrong = (f"during_itae_300_hz_{case}_mean_um" for case in ("adapted", "wrong"))
    assert numbers[wrong] > 2 * numbers[adapted]
    assert numbers["growth_itae_5_khz_per_s"] > 1e3
    assert numbers["growth_kalman_settled_per_s"] < 1e-6
    assert numbers["drives_during_kalman_high_um"] < 0.9


@pytest.mark.cases(0)
def test_checks_fail_where_something_is_wrong(runs):
    task, solution = runs("focus")
    answer = solution.answer
    worse = answer.assign(
        events=answer["events"] + 1,
        false_alarms=answer["false_alarms"] + 100,
        missed=answer["missed"] + 100,
        position_error=1e-6 + answer["position_error"],
        K_obs=1.1 * answer["K_obs"],
        error=10 * answer["error"],
        drive_error=5 * answer["drive_error"],
        followed_last=1.01 * answer["followed_last"],
    )
    failed = {one.split(":")[0] for one in task.certify(worse, 1e-6).failures}
    assert failed >= {
        "loop",
        "quality, clean",
        "quality, scratch",
        "lens",
        "K_obs",
        "Kalman filter, after a scratch",
        "scratch",
        "rotation",
        "drives, scratch",
        "drives, readable",
    }
    swapped = answer["error"].assign_coords(case=["known", "adapted", "wrong"])
    failed = task.certify(answer.assign(error=swapped.sel(case=list(CASES))), 1e-6).failures
    assert any(one.startswith("wrong rotation") for one in failed)


@pytest.mark.slow
def test_another_seed_changes_no_verdict(runs):
    task, solution = runs("focus")
    other = solve(task, options=Options(seed=12))
    first, second = ({c.name: c.holds for c in one.certificate.checks} for one in (solution, other))
    assert first == second
    assert (other.answer["drive_error"] != solution.answer["drive_error"]).all()


@pytest.mark.slow
def test_other_seeds_and_scratches_hold(runs):
    task, _ = runs("focus")
    short = replace(task, scratches=replace(task.scratches, length=0.6e-3, depth=0.8))
    solution = solve(short, options=Options(seed=11))
    assert solution.outcome is Outcome.SOLVED, solution.certificate.failures


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_figures_and_tables(runs, axis):
    task, solution = runs(axis)
    drawn = task.figures(solution.answer)
    assert set(drawn) == {"figure-7-14", "figure-7-15", "rotation", "drives", "graded-quality"}
    for figure in drawn.values():
        assert all(panel.get_ylabel() for panel in figure.axes)
    table = task.tables(solution.answer)["errors"]
    assert all(name in table for name in (*ESTIMATORS, *RIVALS))
