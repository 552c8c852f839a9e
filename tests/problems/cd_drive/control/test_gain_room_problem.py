"""Room of the reference controller's gain: the stored result, and checks that can fail."""

from pathlib import Path

import pytest
from workbench.plants.cd_drive.control.control_problem import generalised
from workbench.plants.cd_drive.control.gain_room import FACTORS, FORMS
from workbench.plants.cd_drive.drive.plants import controller
from workbench.plants.cd_drive.uncertainty.parametric_model import parametric_plant

import workbench as wb
from workbench.mu import performance_peak

REFERENCE = Path(__file__).parents[4] / "results" / "reference"


@pytest.fixture(scope="module")
def run():
    (folder,) = (REFERENCE / "cd" / "focus" / "gain-room").iterdir()
    return wb.open_run(folder)


@pytest.mark.cases(0)
def test_peaks_beside_the_edges_are_on_either_side_of_one(run):
    """Computed anew for one edge."""
    plant = generalised("focus", parametric_plant("focus")).channel(
        performance="z_p", exogenous="w_p"
    )
    ends = run.data["room"].sel(form="parametric", channel="disturbance")
    kept, lost = (float(ends.sel(end=end)) for end in ("low", "below"))
    assert performance_peak(plant, kept * controller("focus"), tolerance=1e-4).upper < 1.0
    assert performance_peak(plant, lost * controller("focus"), tolerance=1e-4).lower > 1.0


def test_fitted_sets_have_no_room(run):
    for form in FORMS[1:]:
        assert run.data["room"].sel(form=form).isnull().all()
        assert run.metrics[f"least_peak_{form}"] > 1.0


def test_both_channels_narrow_the_room(run):
    ends = run.data["room"].sel(form="parametric")
    assert run.metrics["low_parametric"] == pytest.approx(float(ends.sel(end="low").max()))
    assert run.metrics["high_parametric"] == pytest.approx(float(ends.sel(end="high").min()))
    assert FACTORS[len(FACTORS) // 2] == 1.0


@pytest.mark.slow
def test_a_wrong_edge_is_rejected(run):
    study, data = run.task, run.data
    assert study.certify(data, 1e-6).holds
    wider = data["room"].where(data["end"] != "low", 0.5)
    assert not study.certify(data.assign(room=wider.transpose(*data["room"].dims)), 1e-6).holds
    swapped = data["room"].assign_coords(end=["low", "below", "above", "high"])
    swapped = swapped.sel(end=data["end"])
    assert not study.certify(data.assign(room=swapped), 1e-6).holds
