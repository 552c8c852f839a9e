"""The joint fit of all experiments of a drive."""

import numpy as np
import pytest
import xarray as xr
from scipy import stats
from workbench.plants.cd_drive.drive.actuator import SERIES_RESISTANCE, specific_model
from workbench.plants.cd_drive.drive.tables import drives
from workbench.plants.cd_drive.drive.two_masses import lumped, lumped_values
from workbench.plants.cd_drive.laboratory.drive_experiments import DriveExperiments
from workbench.plants.cd_drive.laboratory.identified import NAMES, Identified
from workbench.plants.cd_drive.laboratory.unknowns import Told

import workbench as wb

SEED = 5


def measured(axis):
    """Runs of one drive whose responses are exact but for a little noise."""
    rng = np.random.default_rng(1)
    drive = drives(axis)[0]
    model = specific_model(drive)
    low, high = np.arange(10.0, 100.5, 0.5), np.arange(100.0, 2001.0, 10.0)
    total = drive.R + SERIES_RESISTANCE
    current = SERIES_RESISTANCE / total * (1 - drive.Bl * 2j * np.pi * low * model.response(low))
    motion = model.response(high)
    noise = [rng.normal(size=n) + 1j * rng.normal(size=n) for n in (low.size, high.size)]
    current = current + 1e-5 * noise[0] / np.sqrt(2)
    sigma = 1e-3 * abs(motion)
    motion = motion + sigma * noise[1] / np.sqrt(2)
    told = Told.drawn(axis, SEED).gain  # by the gain that the closed-loop run is told
    motion, sigma = motion / told, sigma / told
    radius = sigma * np.sqrt(stats.f.ppf(0.99, 2, 18))
    open_loop = xr.Dataset(
        {
            "response": ("frequency", current),
            "variance": ("frequency", np.full(low.size, 1e-10), {"degrees": 16.0}),
            "mass": ("draw", [float(lumped(drive).m)]),
        },
        {"frequency": low},
    )
    closed_loop = xr.Dataset(
        {
            "response": ("frequency", motion),
            "radius": ("frequency", radius),
            "seed": ("draw", [SEED]),
        },
        {"frequency": high},
    )
    return drive, DriveExperiments(open_loop, closed_loop, 0)


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_precise_responses_give_the_drive_back(axis):
    drive, found = measured(axis)
    fit = Identified(axis, None)._fit(drive, drive.K_optn, found)
    truth = np.array([getattr(drive, name) for name in NAMES])
    assert np.all(abs(fit.answer[: len(NAMES)] - truth) <= 1.5 * fit.half_width[: len(NAMES)])
    assert np.all(fit.half_width[: len(NAMES)] <= 0.3 * truth)
    assert fit.chi_square == pytest.approx(1.0, abs=0.3)


@pytest.mark.cases(0)
def test_a_wrong_optical_gain_is_told_from_the_responses():
    """But for the mass: one that is heavier by e makes the gain larger by e / 2."""
    drive, measurements = measured("focus")
    fit = Identified("focus", None)._fit(drive, 1.005 * drive.K_optn, measurements)
    found = dict(zip(NAMES, fit.answer[: len(NAMES)], strict=True))
    heavier = lumped_values(found).m / lumped(drive).m
    gain = fit.answer[len(NAMES)]
    assert gain / np.sqrt(heavier) == pytest.approx(1 / 1.005, rel=2e-3)
    assert heavier == pytest.approx(1.0, abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_twelve_drives_are_identified(axis, tmp_path, monkeypatch):
    monkeypatch.setenv("WORKBENCH_RESULTS", str(tmp_path))
    run = wb.run(f"cd/{axis}/identified")
    assert run.certificate.failures == ()
    assert run.metrics["bias_b_lumped"] < -0.1
    assert abs(run.metrics["bias_b_joint"]) < 0.1
    assert run.metrics["covered_lumped"] > 0.9
