"""`workbench init`: a folder from records, or an error that says what to name."""

import json
import re
import shutil
from pathlib import Path

import nbformat
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import lfilter

import workbench as wb
from workbench.bench.project import use_problems
from workbench.bench.verify import verify_folder
from workbench.cli import main
from workbench.errors import InputError
from workbench.starter import study_folder, write_study

ROOT = Path(__file__).parents[2]
RATE, SAMPLES = 200.0, 512


def write_records(folder, header="t [s],torque [N m],speed [rad/s]", noise=1e-3, count=4):
    """Records of first-order servos."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(8)
    lines = np.unique(np.geomspace(1, 200, 40).astype(int))
    angle = 2 * np.pi * np.outer(np.arange(SAMPLES), lines) / SAMPLES
    u = np.tile(np.cos(angle - np.pi * np.arange(40)[: lines.size] ** 2 / 40).sum(axis=1), 4)
    for number in range(count):
        a = np.exp(-5 * (1 + 0.1 * rng.uniform(-1, 1)) / RATE)
        y = np.zeros(u.size)
        for k in range(1, u.size):
            y[k] = a * y[k - 1] + (1 - a) * u[k - 1]
        columns = [np.arange(u.size) / RATE, u, y + noise * rng.normal(size=u.size)]
        np.savetxt(
            folder / f"drive{number}.csv",
            np.column_stack(columns),
            delimiter=",",
            header=header,
            comments="",
            fmt="%.9g",
        )
    return folder / "drive*.csv"


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return write_records(tmp_path_factory.mktemp("records"))


@pytest.fixture
def untried(monkeypatch):
    """Studies are written with their first choices, and nothing is solved."""
    monkeypatch.setattr(study_folder, "kept_weights", lambda design, chosen, *_: chosen)


@pytest.mark.slow
def test_a_study_is_written_from_records_and_keeps_its_weights(records, tmp_path):
    asked = ["init", str(tmp_path / "my-servo"), "--data", str(records)]
    said = CliRunner().invoke(main, asked)
    assert said.exit_code == 0, said.output
    assert "bandwidth" in said.output and "next: cd" in said.output
    assert "read: input 'torque [N m]', output 'speed [rad/s]', time 't [s]'" in said.output
    assert "\n!" not in said.output
    assert "certified: every plant of the cover keeps the weights" in said.output
    folder = tmp_path / "my-servo"
    there = {file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()}
    assert {
        "README.md",
        "pyproject.toml",
        "notebooks/my_servo.ipynb",
        "tests/test_my_servo.py",
        "problems/my_servo/design.py",
        "problems/my_servo/data/drive0.csv",
    } <= there
    nbformat.validate(
        nbformat.from_dict(json.loads((folder / "notebooks/my_servo.ipynb").read_text()))
    )


@pytest.fixture
def study(records, tmp_path, monkeypatch):
    """A study in its folder, with its first choices."""
    monkeypatch.setattr(study_folder, "kept_weights", lambda design, chosen, *_: chosen)
    write_study(tmp_path / "my-servo", str(records))
    monkeypatch.chdir(tmp_path / "my-servo")
    monkeypatch.setenv("WORKBENCH_RESULTS", str(tmp_path / "results"))
    use_problems([])


@pytest.mark.usefixtures("study")
def test_parameters_of_a_study_that_do_not_fit_are_named():
    for parameter in ("bandwidth", "effort"):
        with pytest.raises(InputError, match=rf"{parameter}='-5' does not fit: .*greater than 0"):
            wb.run("my-servo/controller", **{parameter: "-5"})


@pytest.mark.slow
@pytest.mark.usefixtures("study")
def test_a_study_has_a_controller_for_every_plant_of_its_records():
    assert wb.run("my-servo/controller").metrics["peak"] < 1


@pytest.mark.slow
@pytest.mark.usefixtures("study")
def test_a_study_runs_from_the_records_to_the_code():
    board = wb.run("my-servo/board")
    assert board.certificate.holds
    code = (board.path / "controller.h").read_text()
    assert code == board.answer.code()


@pytest.mark.cases(0)
def test_code_that_is_not_of_the_arrays_is_found(tmp_path):
    stored = ROOT / "results" / "reference" / "unstable-first-order"
    shutil.copytree(stored, tmp_path / stored.name)  # with the controller that it needs
    (code,) = (tmp_path / stored.name / "board").glob("*/controller.h")
    assert not any("controller.h" in one for one in verify_folder(code.parent).problems)
    code.write_text(code.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    problems = verify_folder(code.parent).problems
    assert any("controller.h is not what the arrays give" in one for one in problems)


@pytest.mark.parametrize(
    ("header", "given", "message"),
    [
        ("a,b,c", {}, r"has the columns 'a', 'b', 'c'; none is seen to be the input"),
        ("t,a,b", {}, r"the input: name it, --input NAME and the output, --output NAME"),
        ("t,reference,b", {"excitation": "reference"}, "none is seen to be the input"),
        ("t,u,v", {"output": "y"}, r"none is called 'y'; name the output, --output NAME"),
        ("t,torque,force", {}, r"'torque', 'force' may be the input: name it, --input NAME"),
    ],
)
def test_columns_that_leave_it_open_are_named(tmp_path, header, given, message):
    data = write_records(tmp_path / "records", header, count=2)
    with pytest.raises(InputError, match=message):
        write_study(tmp_path / "servo", str(data), **given)
    assert not (tmp_path / "servo").exists()


def test_what_is_there_is_kept(records, tmp_path):
    (tmp_path / "servo").mkdir()
    (tmp_path / "servo" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already; name a new folder"):
        write_study(tmp_path / "servo", str(records))
    assert [file.name for file in (tmp_path / "servo").iterdir()] == ["mine.txt"]


def test_other_misuse_is_named_and_leaves_nothing(records, tmp_path):
    for folder, data, given, message in (
        ("1servo", records, {}, "letters, digits, - and _, a letter first"),
        ("servo", tmp_path / "none*.csv", {}, "no file fits"),
        ("servo", records, {"dt": -1.0}, "dt"),
        ("servo", records, {"dt": 10.0}, "below the first frequency that was measured"),
    ):
        with pytest.raises(InputError, match=message):
            write_study(tmp_path / folder, str(data), **given)
    assert not list(tmp_path.iterdir())


def test_another_sampling_frequency_than_the_column_of_time_tells_is_refused(records, tmp_path):
    with pytest.raises(InputError, match=r"'t \[s\]' rises by 0.005 s a sample, 200 Hz"):
        write_study(tmp_path / "servo", str(records), record_dt=1 / 150.0)
    assert not (tmp_path / "servo").exists()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"limits": (5.0, -5.0)}, "each lowest below its highest"),
        ({"limits": (50.0, 100.0)}, "is not between the limits 50 N m and 100 N m: limits"),
        ({"structure": "pidd"}, "structure"),
        ({"bandwidth_hz": 0.0}, "bandwidth_hz is 0.0"),
        ({"effort": -1.0}, "effort is -1.0"),
    ],
)
def test_demands_that_do_not_fit_are_named(records, tmp_path, given, message):
    with pytest.raises(InputError, match=message):
        write_study(tmp_path / "servo", str(records), **given)
    assert not (tmp_path / "servo").exists()


def test_gains_of_opposite_sign_are_refused_and_why(tmp_path):
    write_records(tmp_path / "records", count=3)
    file = tmp_path / "records/drive1.csv"
    table = np.loadtxt(file, delimiter=",", skiprows=1) * [1, 1, -1]
    header = "t [s],torque [N m],speed [rad/s]"
    np.savetxt(file, table, delimiter=",", header=header, comments="")
    with pytest.raises(InputError, match=r"opposite sign .*drive0.*drive1.*no fixed linear"):
        write_study(tmp_path / "servo", str(tmp_path / "records/*.csv"))


@pytest.mark.usefixtures("untried")
def test_what_is_asked_stands_in_the_study(records, tmp_path):
    asked = {"structure": "pid", "bandwidth_hz": 0.7, "limits": (-9.0, 11.0), "effort": 0.02}
    write_study(tmp_path / "servo", str(records), **asked)
    text = (tmp_path / "servo" / "problems" / "servo" / "design.py").read_text()
    for line in ('STRUCTURE, STATES = "pid"', "BANDWIDTH = 0.7", "LOWEST, HIGHEST = -9.0, 11.0",
                 "EFFORT = 0.02", "POINT = WorkingPoint("):  # fmt: skip
        assert line in text
    assert 'u_unit="N m", y_unit="rad/s"' in text


def test_one_record_in_two_files_is_refused(tmp_path):
    write_records(tmp_path / "records", count=2)
    (tmp_path / "records/copy.csv").write_bytes((tmp_path / "records/drive1.csv").read_bytes())
    with pytest.raises(InputError, match=r"drive1\.csv and .*copy\.csv hold the same record"):
        write_study(tmp_path / "servo", str(tmp_path / "records/*.csv"))


@pytest.mark.usefixtures("untried")
def test_input_and_output_in_each_others_place_are_noticed(records, tmp_path):
    exchanged = {"input": "speed", "output": "torque"}
    try:
        notes = " ".join(write_study(tmp_path / "servo", str(records), **exchanged).notes)
    except InputError as error:
        notes = str(error)
    assert "are input and output exchanged?" in notes


@pytest.mark.usefixtures("untried")
def test_a_column_is_named_without_its_unit(records, tmp_path):
    write_study(tmp_path / "servo", str(records), input="torque", output="speed", time="t")
    text = (tmp_path / "servo" / "problems" / "servo" / "design.py").read_text()
    assert 'INPUT, OUTPUT = "torque [N m]", "speed [rad/s]"' in text


@pytest.mark.usefixtures("untried")
def test_named_columns_and_a_sampling_frequency_are_taken(tmp_path):
    data = write_records(tmp_path / "records", "a,b,c", count=3)
    chosen = write_study(
        tmp_path / "servo", str(data), input="b", output="c", record_dt=1 / RATE, dt=0.02
    )
    text = (tmp_path / "servo" / "problems" / "servo" / "design.py").read_text()
    assert 'SAMPLES = {"dt": 0.005}' in text
    assert f"BANDWIDTH = {chosen.bandwidth_hz}" in text
    assert "PERIOD, DELAY" in text and "0.02" in text


def test_the_band_of_a_study_holds_the_lines_at_its_ends(records, tmp_path, untried):
    """Sampling times are rounded in files, so that a line lies beside a short number."""
    chosen = write_study(tmp_path / "servo", str(records), input="torque", output="speed")
    text = (tmp_path / "servo/problems/servo/design.py").read_text(encoding="utf-8")
    (low, high) = map(float, re.search(r"^BAND = \((.*), (.*)\)$", text, re.M).groups())
    assert low < chosen.band_hz[0] * (1 - 1e-6) and high > chosen.band_hz[1] * (1 + 1e-6)
    assert low > chosen.band_hz[0] * (1 - 1e-4) and high < chosen.band_hz[1] * (1 + 1e-4)


@pytest.mark.usefixtures("untried")
def test_the_tries_of_a_study_end_by_counts(records, tmp_path):
    """A limit in seconds would find another design on a busy computer."""
    write_study(tmp_path / "servo", str(records))
    text = (tmp_path / "servo/problems/servo/design.py").read_text(encoding="utf-8")
    assert "time_limit" not in text


@pytest.mark.usefixtures("untried")
def test_the_simulated_step_is_one_that_a_record_has_seen(records, tmp_path):
    """An integrator has no static gain by which a step could be chosen."""
    write_study(tmp_path / "servo", str(records))
    text = (tmp_path / "servo/problems/servo/design.py").read_text(encoding="utf-8")
    step = float(re.search(r"^TRIED_STEP = (.*)$", text, re.M)[1])
    files = records.parent.glob("*.csv")
    speeds = [np.loadtxt(file, delimiter=",", skiprows=1)[:, 2] for file in files]
    assert step == pytest.approx(max(map(np.ptp, speeds)) / 2, rel=1e-2)


@pytest.mark.parametrize("away", [-4e-12, 4e-12])
def test_a_line_at_a_tenth_of_the_sampling_rate_is_used_however_times_are_rounded(
    tmp_path, untried, away
):
    """Of a sampling time that is told to nine digits, the last line may lie beyond the tenth."""
    rng, lines, count = np.random.default_rng(2), np.arange(1, 51, 7), 500
    angle = 2 * np.pi * np.outer(np.arange(count), lines) / count
    u = np.tile(np.cos(angle + rng.uniform(0, 6, lines.size)).sum(axis=1), 4)
    time = (0.01 + away) * np.arange(u.size)
    for k in (1, 2):
        y = lfilter([0.0, 0.1 * k], [1.0, -0.9], u) + 1e-3 * rng.standard_normal(u.size)
        table = np.column_stack([time, u, y])
        np.savetxt(tmp_path / f"lag{k}.csv", table, delimiter=",", header="time,u,y", comments="")
    chosen = write_study(tmp_path / "lag", str(tmp_path / "lag*.csv"))
    assert chosen.band_hz[1] == pytest.approx(10.0, rel=1e-6)
