"""Responses of plants in closed loops, from files: the excitation is a column that is named."""

import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from workbench.cli import main
from workbench.errors import InputError
from workbench.identification.record_tests import report as frame
from workbench.identification.record_tests.finding import Finding
from workbench.identification.record_tests.finding import TestedAssumption as ToldAssumption
from workbench.starter import study_folder
from workbench.uncertainty import Responses, StadiumCover
from workbench.uncertainty.responses.regions import region_radius, with_regions

sys.path.append(str(Path(__file__).parents[1] / "identification"))
from simulated_loops import records_of


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Records of three lags under PI, as files; and the plant."""
    folder = tmp_path_factory.mktemp("loops")
    rng = np.random.default_rng(3)
    u, y, r, plant = records_of("lag", "binary", 30.0, 2000, 3, rng)
    for k in range(3):
        rows = np.column_stack([np.arange(2000) * 0.5, u[:, k], y[:, k], r[:, k], u[:, k]])
        np.savetxt(
            folder / f"oven{k}.csv", rows, delimiter=",", comments="", fmt="%.12g",
            header="t [s],power [W],temp [K],set [K],copy",
        )  # fmt: skip
    return str(folder / "oven*.csv"), plant


NAMES = {"input": "power", "output": "temp", "time": "t"}


def forbids_undriven(record):
    """A test that finds feedback in every record without an excitation."""
    found = Finding(
        "feedback", "the input follows the output", "power", 0.5, "share", "name excitation=",
        forbids=record.r is None,
    )  # fmt: skip
    return ToldAssumption("open loop", "half of it", findings=(found,))


@pytest.fixture
def closed(monkeypatch):
    monkeypatch.setattr(frame, "TESTS", (forbids_undriven,))


@pytest.mark.cases(0)
def test_records_of_loops_are_refused_by_name_unless_the_excitation_is_told(files, closed):
    with pytest.raises(InputError, match=r"oven0\.csv: feedback.*excitation=.*open loop"):
        Responses.from_files(files[0], **NAMES)
    found = Responses.from_files(files[0], **NAMES, excitation="set")
    assert "from the excitation" in found.read
    assert found.tested == ("open loop: tested; half of it",)
    exact = files[1](np.exp(0.5j * found.omega)).ravel()[:, None]
    inside = np.abs(found.values - exact) <= region_radius(found, 0.95)
    assert inside.mean() >= 0.93
    assert Responses.from_files(files[0], **NAMES, assume="open loop").tested == (
        "open loop: assumed by the user, against the finding: the input follows the output",
    )


def test_regions_stay_with_their_responses(files):
    found = Responses.from_files(files[0], **NAMES, excitation="set")
    part = found.within(0.01, 0.1)
    assert part.ratios.joint.shape[:2] == part.values.shape
    held = Responses.from_files(files[0], **NAMES, excitation="set", hold=True)
    ratio = region_radius(held, 0.9) / np.abs(held.values)
    np.testing.assert_allclose(ratio, region_radius(found, 0.9) / np.abs(found.values), rtol=1e-6)
    corners = with_regions(part, 0.9)
    assert corners.ratios is None and corners.reports == part.reports


def test_a_spread_about_one_plant_keeps_its_regions(files):
    one = str(Path(files[0]).parent / "oven0.csv")
    found = Responses.from_files(one, **NAMES, excitation="set", spread=0.2, resonance_shift=0.05)
    assert found.ratios.joint.shape[:2] == found.values.shape
    share = region_radius(found, 0.9) / np.abs(found.values)
    assert np.isfinite(share).all() and share.max() < 10


def test_lines_whose_regions_have_no_end_are_left_out(files):
    found = Responses.from_files(files[0], **NAMES, excitation="set").within(0.0, 0.1)
    joint = found.ratios.joint.copy()
    joint[3] *= 1e6
    wide = Responses(
        omega=found.omega, values=found.values, variance=found.variance, degrees=found.degrees,
        ratios=type(found.ratios)(joint, found.ratios.chosen),
    )  # fmt: skip
    with pytest.warns(UserWarning, match="has no end"):
        assert with_regions(wide, 0.95).omega.size == found.omega.size - 1


def test_a_cover_of_driven_plants_holds_and_says_what_was_tested(files):
    found = Responses.from_files(files[0], **NAMES, excitation="set").within(0.005, 0.1)
    cover = StadiumCover(found, 2, zeros=1, confidence=0.9)
    assert cover.facts(None) == found.tested


BAD = {
    "no such column": ({"excitation": "force"}, "force"),
    "the input": ({"excitation": "power"}, "excitation 'power'.*input itself"),
    "a copy of the input": ({"excitation": "copy"}, "excitation 'copy'.*input itself"),
    "no name": ({"excitation": 3.5}, "3"),
    "an empty name": ({"excitation": ""}, "excitation|column|variable|''"),
    "no assumption": ({"assume": 3.0}, "assume"),
    "an assumption that is none": ({"assume": ["open lop"]}, "open lop"),
    "of a response": ({"excitation": "set", "input": None, "output": None}, "name input="),
    "a list of names": ({"excitation": ["set"]}, "set|excitation"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_excitations_are_named(case, files, closed):
    given, words = BAD[case]
    with pytest.raises((InputError, LookupError), match=words):
        Responses.from_files(files[0], **NAMES | given)


def test_init_takes_the_excitation_and_the_study_names_it(files, closed, tmp_path, monkeypatch):
    monkeypatch.setattr(
        study_folder, "kept_weights", lambda design, chosen, lower, structure: chosen
    )
    asked = ["init", str(tmp_path / "oven"), "--data", files[0], "--input", "power"]
    asked += ["--output", "temp", "--time", "t"]
    said = CliRunner().invoke(main, asked)
    assert said.exit_code != 0 and "excitation=" in str(said.output) + str(said.exception)
    said = CliRunner().invoke(main, [*asked, "--excitation", "set"])
    assert "assumed  open loop: tested" in said.output, said.output + str(said.exception)
    design = (tmp_path / "oven" / "problems" / "oven" / "design.py").read_text()
    assert "KNOWN = {'excitation': 'set'}" in design and "**KNOWN" in design
    compile(design, "design.py", "exec")
    assert "open loop: tested" in (tmp_path / "oven" / "README.md").read_text()


def test_files_of_a_loop_whose_excitation_was_not_recorded(tmp_path):
    u, y, _, plant = records_of("lag", "periodic", 3.0, 2000, 2, np.random.default_rng(8))
    for k in range(2):
        rows = np.column_stack([np.arange(2000) * 0.5, u[:, k], y[:, k]])
        np.savetxt(
            tmp_path / f"oven{k}.csv", rows, delimiter=",", header="t,power,temp", comments=""
        )
    files = str(tmp_path / "oven*.csv")
    with pytest.raises(InputError, match=r"feedback.*samples of its period"):
        Responses.from_files(files, **NAMES)
    found = Responses.from_files(files, **NAMES, excitation=256)
    assert "period 256 samples" in found.read
    assert any("not recorded, and stated to repeat" in one for one in found.tested)
    exact = plant(np.exp(0.5j * found.omega)).ravel()
    assert (np.abs(found.values - exact[:, None]) <= region_radius(found, 0.99)).mean() > 0.95
    with pytest.raises(InputError, match="a period of 2 to 1000 samples"):
        Responses.from_files(files, **NAMES, excitation=1500)
