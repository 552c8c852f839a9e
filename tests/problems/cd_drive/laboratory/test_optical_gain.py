"""Optical gains from scans against Table A.3, and what each step of the scans rests on."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.experiment import Laboratory
from workbench.plants.cd_drive.laboratory.optical_gain import OPTICAL_GAINS, OpticalGain
from workbench.plants.cd_drive.laboratory.scans import (
    RAMP_TIME,
    SHOWN_DISTANCE,
    focus_scan,
    radial_scan,
    ramps,
)

from workbench import Options, solve

QUIET = {"noise": 0.0, "electronics": 0.0}
PASSES = {"focus": 12, "radial": 6}


@pytest.fixture(scope="module", params=[pytest.param("focus", marks=pytest.mark.slow), "radial"])
def solved(request):
    study = OpticalGain(request.param, PASSES[request.param])
    return study, solve(study, options=Options(seed=4))


def test_gains_and_their_spreads_come_back(solved):
    study, solution = solved
    assert solution.certificate.failures == ()
    metrics = study.metrics(solution.answer)
    assert metrics["worst_error"] < 0.02
    stated = {"focus": (0.545, 0.182), "radial": (0.282, 0.110)}[study.axis]  # by Table A.3 itself
    assert metrics["spread_K_opt"] == pytest.approx(stated[0], abs=0.02)
    assert metrics["spread_K_optn"] == pytest.approx(stated[1], abs=0.02)


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


def test_a_wrong_gain_fails(solved):
    study, solution = solved
    spoiled = solution.answer.assign(gain=solution.answer["gain"] * 1.03)
    assert not any(check.holds for check in study.checks(spoiled, 1e-6)[: len(OPTICAL_GAINS)])


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
