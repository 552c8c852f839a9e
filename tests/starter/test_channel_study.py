"""Studies of several channels: which records belong to which input, options, and a whole study."""

import subprocess
import sys
from pathlib import Path

import control
import numpy as np
import pytest
from click.testing import CliRunner

from workbench.cli import main
from workbench.errors import InputError
from workbench.starter import ChannelChoices, write_channel_study

NAMES = {"inputs": ["hot", "cold"], "outputs": ["level", "warmth"]}


def write_pair(folder, *, samples=2000, mixed=False):
    """Records of three plants with two equal lags that act on each other a little."""
    rng, time = np.random.default_rng(0), np.arange(samples) * 0.01
    for k in (1, 2, 3):
        lag = control.tf([8 + k], [1, 9])
        plant = control.append(lag, lag)
        for j in (0, 1):
            u = np.zeros((2, samples))
            u[j] = 50 + np.tile(rng.standard_normal(samples // 8), 8)
            u[1 - j] = 50 + (u[j] - 50 if mixed else 0.0)
            moved = u - 50
            y = control.forced_response(plant, time, moved + 0.2 * moved[::-1]).outputs
            np.savetxt(
                folder / f"plant{k}-{j}.csv", np.c_[time, u.T, y.T],
                delimiter=",", header="time,hot,cold,level,warmth", comments="",
            )  # fmt: skip


def test_a_record_must_move_one_input(tmp_path):
    write_pair(tmp_path, samples=400, mixed=True)
    with pytest.raises(InputError, match=r"moves 'hot', 'cold'; a record must move one"):
        write_channel_study(tmp_path / "pair", str(tmp_path / "*.csv"), **NAMES)
    assert not (tmp_path / "pair").exists()


def test_one_input_holds_one_output(tmp_path):
    write_pair(tmp_path, samples=400)
    with pytest.raises(InputError, match=r"2 outputs cannot follow .* by 1 input:"):
        write_channel_study(
            tmp_path / "pair", str(tmp_path / "*.csv"), inputs=["hot"], outputs=NAMES["outputs"]
        )


def test_every_input_needs_two_plants(tmp_path):
    write_pair(tmp_path, samples=400)
    few = [str(tmp_path / f"plant{k}-{j}.csv") for k, j in ((1, 0), (2, 0), (1, 1))]
    with pytest.raises(InputError, match="1 record moves 'cold'"):
        write_channel_study(tmp_path / "pair", few, **NAMES)


def test_limits_belong_to_every_input(tmp_path):
    write_pair(tmp_path, samples=400)
    asked = {"limits": [(0.0, 100.0)], **NAMES}
    with pytest.raises(InputError, match="1 limits are given for 2 inputs"):
        write_channel_study(tmp_path / "pair", str(tmp_path / "*.csv"), **asked)
    asked["limits"] = [(0.0, 100.0), (60.0, 100.0)]
    with pytest.raises(InputError, match="is not between the limits"):
        write_channel_study(tmp_path / "pair", str(tmp_path / "*.csv"), **asked)


def test_a_delay_is_a_number_of_samples(tmp_path):
    write_pair(tmp_path, samples=400)
    with pytest.raises(InputError, match="delay_samples is 'x'; it must be a number of samples"):
        write_channel_study(tmp_path / "pair", str(tmp_path / "*.csv"), delay_samples="x", **NAMES)


ASKED = [
    *("init", "pair", "--data", "plant*.csv", "--input", "hot", "--input", "cold"),
    *("--output", "level", "--output", "warmth"),
]


def test_init_passes_several_inputs_on(monkeypatch):
    told = {}

    def study(folder, data, **given):
        told.update(given)
        reasons = {"bandwidth_hz": "first", "effort": "least gain"}
        return ChannelChoices(0.5, 0.1, {}, ((1.0,), (1.0,)), reasons, peak=0.9, states=7)

    monkeypatch.setattr("workbench.starter.write_channel_study", study)
    limits = ["--limits", "0", "100", "--limits", "10", "90"]
    said = CliRunner().invoke(main, [*ASKED, *limits])
    assert said.exit_code == 0 and "0.9, certified" in said.output
    assert told["inputs"] == ("hot", "cold") and told["outputs"] == ("level", "warmth")
    assert told["limits"] == ((0.0, 100.0), (10.0, 90.0)) and told["delay_samples"] == 1.0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--structure", "pid"], "--structure is for plants of one input"),
        (["--recovery-time", "3"], "--recovery-time is for plants of one input"),
        (["--assume", "open loop"], "--assume is for plants of one input"),
    ],
)
def test_init_refuses_options_of_one_channel(more, words):
    said = CliRunner().invoke(main, [*ASKED, *more])
    assert said.exit_code == 2 and words in said.output


def test_init_needs_the_name_of_every_column():
    said = CliRunner().invoke(main, ASKED[:-4])
    assert said.exit_code == 2 and "name every column" in said.output


@pytest.mark.slow  # four covers and a synthesis of two channels, twice
def test_from_the_records_to_the_code(tmp_path, monkeypatch):
    write_pair(tmp_path)
    monkeypatch.chdir(tmp_path)
    chosen = write_channel_study("pair", "*.csv", **NAMES, bandwidth_hz=0.2)
    assert chosen.peak < 1 and sorted(chosen.channels) == ["1-1", "1-2", "2-1", "2-2"]
    monkeypatch.chdir(tmp_path / "pair")
    run = "import workbench as wb; b = wb.run('pair/board'); assert b.holds; print(b.path)"
    said = subprocess.run(
        [sys.executable, "-c", run], capture_output=True, text=True, check=True
    ).stdout
    code = (Path(said.splitlines()[-1]) / "controller.h").read_text(encoding="utf-8")
    assert "r[2]" in code and "u[2]" in code
