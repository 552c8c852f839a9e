"""Optical gains from scans against Table A.3, and what each step of the scans rests on."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.optical_gain import OpticalGain
from workbench.plants.cd_drive.laboratory.scans import (
    RAMP_TIME,
    SHOWN_DISTANCE,
    focus_scan,
    radial_scan,
    ramps,
)

from workbench import Options, solve

QUIET = {"noise": 0.0, "electronics": 0.0}
PASSES = {"focus": 6, "radial": 6}


@pytest.fixture(scope="module", params=[pytest.param("focus", marks=pytest.mark.slow), "radial"])
def solved(request):
    study = OpticalGain(request.param, PASSES[request.param], 2)
    return study, solve(study, options=Options(seed=4))


@pytest.mark.cases(0)
def test_gains_and_their_spreads_come_back(solved):
    study, solution = solved
    assert solution.certificate.failures == ()
    metrics = study.metrics(solution.answer)
    assert metrics["error_K_optn_known_distance_high"] < 0.02
    assert metrics["covered_K_opt"] > 0.9 and metrics["covered_K_optn"] > 0.9
    stated = {"focus": (0.545, 0.182), "radial": (0.282, 0.110)}[study.axis]  # by Table A.3 itself
    assert metrics["spread_K_opt_mean"] == pytest.approx(stated[0], abs=0.05)
    assert metrics["spread_K_optn_mean"] == pytest.approx(stated[1], abs=0.05)


def test_scans_look_as_the_figures_do(solved):
    study, solution = solved
    normalised = solution.answer["normalised"]
    assert normalised["distance"].values[[0, -1]] == pytest.approx(
        [-SHOWN_DISTANCE[study.axis], SHOWN_DISTANCE[study.axis]]
    )
    if study.axis == "focus":
        extremes = normalised["distance"].values[[normalised.values.argmin(axis=1)]]
        assert extremes == pytest.approx(-6e-6, abs=2e-6)
        assert abs(normalised.values).max() == pytest.approx(1.0, abs=0.1)
    else:
        rising = np.diff(np.sign(normalised.sel(drive="CD1").values)) > 0
        crossings = normalised["distance"].values[:-1][rising]
        assert np.diff(crossings) == pytest.approx(1.6e-6, rel=0.05)


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    assert study.tables(stored)["gains"].count("| CD") == 12
    name = "s-curve" if study.axis == "focus" else "track-scan"
    assert study.figures(stored).keys() == {name, "gains"}


def test_wrong_gains_and_narrow_intervals_fail(solved):
    study, solution = solved
    wrong = solution.answer.assign(found=solution.answer["found"] * 1.1)
    failing = {check.name for check in study.checks(wrong, 1e-6) if not check.holds}
    assert {"K_opt", "K_optn"} <= failing
    narrow = solution.answer.assign(half_width=solution.answer["half_width"] * 0.05)
    failing = {check.name for check in study.checks(narrow, 1e-6) if not check.holds}
    assert {"K_opt covered", "K_optn covered"} <= failing


@pytest.mark.slow
def test_intervals_cover_in_many_draws_whatever_the_seed():
    for seed in (0, 1):
        study = OpticalGain("radial", 4, 12)
        solution = solve(study, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate


def test_no_law_of_the_s_curve_is_needed_for_a_rough_gain():
    """Its extremes are found within 8 %, the sharpest ones farthest off."""
    scan = focus_scan(Laboratory("focus", "CD7", **QUIET), 2, 0)
    assert 0.03 < scan.law < 0.08
    assert focus_scan(Laboratory("focus", "CD4", **QUIET), 2, 0).law < 0.02


@pytest.mark.parametrize("axis", ["focus", "radial"])
@pytest.mark.parametrize("row", [3, 6])
def test_methods_are_right_without_noise(axis, row):
    """Least and most steep s-curve."""
    drive = drives(axis)[row]
    scan = focus_scan if axis == "focus" else radial_scan
    gains = scan(Laboratory(axis, drive.name, **QUIET), 2, 0).gains
    assert gains == pytest.approx([drive.K_opt, drive.K_optn], rel=2e-3)


def test_ramps_are_even():
    """Position over time is straight within a thousandth or two of the s-curve's 12 um."""
    position = Laboratory("focus", "CD1", **QUIET).open_loop(ramps(2)).x
    flank = position[round(2 * RAMP_TIME * RATE) :][: round(RAMP_TIME / 2 * RATE)]
    near = flank[np.abs(flank) < 6e-6]
    assert near.size > 1000
    time = np.arange(near.size)
    assert np.polyval(np.polyfit(time, near, 1), time) == pytest.approx(near, abs=20e-9)
