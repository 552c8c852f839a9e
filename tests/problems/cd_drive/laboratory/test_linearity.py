"""Harmonic distortion of the experiments, and what it is made of."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.disc import Disc
from workbench.plants.cd_drive.laboratory.experiment import STILL, Laboratory
from workbench.plants.cd_drive.laboratory.linearity import (
    Linearity,
    closed_loop,
    closed_loop_amplitude,
    percent,
)

from workbench import Options, solve

QUIET = {"noise": 0.0, "electronics": 0.0, "bits": None}


@pytest.fixture(scope="module", params=["focus", "radial"])
def solved(request):
    study = Linearity(Laboratory(request.param, "CD1"), 16, 3)
    return study, solve(study, options=Options(seed=5))


@pytest.mark.cases(0)
def test_levels_are_those_of_the_text(solved):
    study, solution = solved
    assert solution.certificate.failures == ()
    metrics = study.metrics(solution.answer)
    assert max(metrics["input_open_percent_high"], metrics["output_open_percent_high"]) < 0.5
    assert 2.0 < metrics["output_closed_percent_low"] < metrics["output_closed_percent_high"] < 10.0
    assert metrics["input_closed_first_percent_mean"] > 30.0
    assert metrics["input_closed_last_percent_high"] < 5.0


@pytest.mark.cases(1)
def test_more_harmonics_add_little_to_the_output(solved):
    """And of what they add most is noise: without it there is hardly any."""
    study, solution = solved
    five, eight = (
        study.metrics(solution.answer)[f"output_closed_{n}_harmonics_percent"] for n in (5, 8)
    )
    assert 1.0 <= eight / five < 1.15


@pytest.mark.slow
def test_another_seed_changes_no_verdict(solved):
    study, _ = solved
    for seed in (0, 1):
        assert solve(study, options=Options(seed=seed)).certificate.holds


def test_distortion_is_that_of_the_optics(solved):
    """The s-curve is straight where the experiment is; the tracks' sine is not."""
    study, solution = solved
    level = study.metrics(solution.answer)["output_distortion_percent"]
    lowest, highest = (0.0, 0.05) if study.laboratory.axis == "focus" else (0.5, 3.0)
    assert lowest < level < highest


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    assert study.tables(stored)["thd"].count("\n") == 2 + 2 * 16
    assert study.figures(stored).keys() == {"thd"}


def test_a_distorted_output_fails(solved):
    study, solution = solved
    thd = solution.answer["thd"].copy()
    thd.loc[{"channel": "output"}] += 20.0
    failing = study.certify(solution.answer.assign(thd=thd), 1e-6).failures
    assert len(failing) == 2
    assert "input and output within 1 %" in failing[0] and "output below 10 %" in failing[1]


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_excitation_moves_the_lens_as_far_as_wanted(axis):
    """The frequency that moves it most decides."""
    frequency = np.array([150.0, 300.0, 700.0])
    alone = [closed_loop_amplitude(axis, frequency[[i]]) for i in range(3)]
    assert closed_loop_amplitude(axis, frequency) == pytest.approx(min(alone))
    assert max(alone) < 10.0


def test_beyond_the_straight_part_distortion_rises():
    """A lens held 1.5 um off its focus swings beyond the s-curve's straight part."""
    bench, frequency = Laboratory("focus", "CD1", **QUIET), np.array([700.0, 900.0])
    straight = percent(closed_loop(bench, frequency, 0, STILL)[1])
    moving = percent(closed_loop(bench, frequency, 0, Disc(warp=(1e-3,), rotation=9.0))[1])
    assert straight.max() < 0.1
    assert moving.max() > 10 * straight.max()
