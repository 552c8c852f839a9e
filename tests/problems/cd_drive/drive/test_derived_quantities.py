"""What follows from the tables alone: resonances and coil against the models, sums by hand."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive import derived_quantities as derived
from workbench.plants.cd_drive.drive import tables
from workbench.plants.cd_drive.drive.actuator import (
    SERIES_RESISTANCE,
    general_model,
    specific_model,
)
from workbench.plants.cd_drive.drive.shared_parameters import WINDOWS
from workbench.plants.cd_drive.laboratory.bench_setup import electromechanics

from workbench import load, solve

DRIVES = [drive for axis in tables.AXES for drive in tables.drives(axis)]
CD1 = tables.drives("focus")[0]


def test_by_hand():
    found = {name: one.of(CD1) for name, one in derived.DERIVED.items()}
    assert found["quality"] == pytest.approx(np.sqrt(20.5 * 0.56e-3) / 7.6e-3)
    assert found["coil pole"] == pytest.approx(18.4 / (2 * np.pi * 160e-6))
    assert found["r over R"] == pytest.approx(1.25 / 18.7)
    assert found["R off"] == pytest.approx(0.3 / 18.4)
    assert found["b2 over b"] == pytest.approx(0.35 / 7.6)
    assert found["k off"] == pytest.approx(20.5 - 23.6 * 157.4 / 181.0)
    assert abs(found["b off"]) < 1e-12


@pytest.mark.parametrize("drive", DRIVES, ids=lambda drive: f"{drive.name}-{drive.axis}")
def test_height_place_and_decay_of_the_peak(drive):
    """Of the lumped model, whose inductance moves the peak by less than a percent."""
    model = general_model(drive)
    frequency = np.arange(20.0, 70.0, 0.005)
    size = abs(model.response(frequency))
    at_rest = drive.Bl / drive.k / (drive.R + SERIES_RESISTANCE)
    damping = drive.b + derived.electric_damping(drive)
    assert size.max() / at_rest == pytest.approx(derived.quality_factor(drive, damping), rel=0.01)
    peak = frequency[size.argmax()]
    assert peak == pytest.approx(derived.peak_frequency(drive), rel=0.002)
    assert -model.poles()[0].real == pytest.approx(derived.decay(drive), rel=0.01)


@pytest.mark.parametrize("resonance", ["first resonance", "parasitic resonance"])
def test_current_of_the_coil(resonance):
    """As the laboratory's channel v_r shows it, its filter and level taken out."""
    system = electromechanics(specific_model(CD1), 1.0)
    s = 2j * np.pi * np.linspace(*WINDOWS["focus"][resonance], 400)
    level = SERIES_RESISTANCE / (CD1.R + SERIES_RESISTANCE)
    current = abs(system(s)[1, 0] / system(s)[2, 0]) / level
    assert np.ptp(current) == pytest.approx(derived.shown_by_current(CD1, resonance), rel=1e-6)


def test_problem_stores_them():
    study = load("cd/drives", frequencies=5)
    answer = solve(study).answer
    assert answer["derived"].shape == (2, 12, len(derived.DERIVED))
    off = answer["derived"].sel(quantity="k off", axis="radial")
    wrong = off["drive"].values[abs(off.values) > 0.15]
    assert wrong.tolist() == ["CD4", "CD9"]
    assert "| quality [1]" in study.tables(answer)["derived"]
    metrics = study.metrics(answer)
    assert metrics["K_total_by_eq_3_18_focus"] == pytest.approx(55857, abs=1)
    assert metrics["table_3_2_off"] < 1e-12 and metrics["equation_3_10_off"] < 1e-12


def test_a_wrong_general_model_is_found():
    study = load("cd/drives", frequencies=5)
    answer = solve(study).answer
    answer["actuator_general"] *= 1.001
    assert study.metrics(answer)["equation_3_10_off"] == pytest.approx(1e-3, rel=1e-6)
    checks = study.certify(answer, 1e-6).checks
    assert [check.name for check in checks if not check.holds] == ["equation 3.10"]
