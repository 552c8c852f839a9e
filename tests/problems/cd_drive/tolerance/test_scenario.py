"""Scenarios from dictionaries and files: what they make, many of them, and what they refuse."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.disc import Disc
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.tolerance.scenario import (
    Scenario,
    Shock,
    Stage,
    read_scenario,
    scenario,
)

from workbench.errors import InputError
from workbench.executor import InProcess, spread

SCRIPT = {
    "duration": 0.3,
    "seed": 3,
    "false_alarms": [[0.25, 0.251]],
    "bench": {"axis": "focus", "drive": "CD3"},
    "disc": {"warp": [300e-6], "rotation": 6.0, "run_up": 0.1},
    "defects": [{"length": 1e-3, "depth": 0.7, "present": [0.1, 1.0]}],
    "shocks": [{"time": 0.2, "acceleration": 5.0}],
    "stages": [{"strategy": "reference"}, {"strategy": "C", "time": 0.15}],
}
TOML = """
duration = 0.3
seed = 3
false_alarms = [[0.25, 0.251]]
[bench]
axis = "focus"
drive = "CD3"
[disc]
warp = [300e-6]
rotation = 6.0
run_up = 0.1
[[defects]]
length = 1e-3
depth = 0.7
present = [0.1, 1.0]
[[shocks]]
time = 0.2
acceleration = 5.0
[[stages]]
strategy = "reference"
[[stages]]
strategy = "C"
time = 0.15
"""


def largest_error(given: Scenario) -> float:
    record = given.run()
    return float(abs(record.x_cd - record.x).max())


def test_a_script_and_a_file_make_the_same_run(tmp_path):
    path = tmp_path / "scenario.toml"
    path.write_text(TOML)
    assert read_scenario(path) == scenario(SCRIPT)
    record = scenario(SCRIPT).run()
    assert len(record.time) == round(0.3 * RATE)
    quality = record.signals["w_Q"]
    assert (quality[round(0.25 * RATE) : round(0.251 * RATE)] == 0.0).all()
    assert (quality[record.light < 0.35] == 0.0).any()
    assert np.isnan(record.signals["u_f"][: round(0.15 * RATE)]).all()
    assert np.isfinite(record.signals["u_f"][round(0.15 * RATE) :]).all()
    calm = scenario(SCRIPT | {"shocks": []}).run()
    assert (calm.x == record.x)[: round(0.2 * RATE)].all()
    assert abs(calm.x - record.x).max() > 1e-7


def test_a_disc_that_slows_down():
    time = np.arange(0.0, 3.0, 1 / 35e3)
    disc = Disc(rotation=6.0, phase=0.1, speed=((0.5, 1.0), (1.5, 0.5), (2.0, 0.5)))
    revolutions, rotation = disc.turned(time)
    assert rotation[[0, 35000, 70000, -1]] == pytest.approx([6.0, 4.5, 3.0, 3.0], abs=1e-3)
    np.testing.assert_allclose(np.gradient(revolutions, time)[1:-1], rotation[1:-1], rtol=1e-3)
    assert revolutions[-1] == pytest.approx(0.1 + 6 * (0.5 + 0.75 + 1.5 * 0.5), abs=1e-3)
    steady = Disc(rotation=6.0, phase=0.1, speed=((0.0, 1.0),)).turned(time)[0]
    np.testing.assert_allclose(steady, Disc(rotation=6.0, phase=0.1).turned(time)[0], atol=1e-12)
    for wrong in (((1.0, 1.0), (0.5, 1.0)), ((-1.0, 1.0),), ((0.0, np.nan),)):
        with pytest.raises(InputError, match="times must increase"):
            Disc(speed=wrong)
    with pytest.raises(InputError, match="factors must not be negative"):
        Disc(speed=((0.0, -1.0),))


def test_many_scenarios_through_an_executor():
    base = replace(scenario(SCRIPT), duration=0.27)
    many = [replace(base, seed=seed) for seed in range(5)]
    told = []
    expected = [largest_error(one) for one in many]
    assert len(set(expected)) == 5
    for executor in (InProcess(), ThreadPoolExecutor(2)):
        with executor:
            found = spread(
                largest_error,
                many,
                executor,
                progress=lambda *step: told.append(step),
                description="runs",
                batch=2,
            )
        assert found == expected
        assert told[0] == ("runs", 0, 5)
        assert [step[1] for step in told] == sorted(step[1] for step in told)
        assert told.pop() == ("runs", 5, 5)
        told.clear()
    with pytest.raises(InputError, match="batch is 0"):
        spread(largest_error, many, InProcess(), batch=0)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"duraton": 1.0}, r"unknown key duraton; known there: bench, disc, .*duration"),
        ({"disc": {"warpp": [1e-6]}}, r"unknown key disc\.warpp; known there: warp, "),
        ({"bench": {"drives": "CD1"}}, r"unknown key bench\.drives; known there: axis, drive"),
        ({"defects": [{"lenth": 1.0}]}, r"unknown key defects\.0\.lenth; known there: length"),
        ({"shocks": [{"size": 1.0}]}, r"unknown key shocks\.0\.size; known there: time"),
        ({"stages": [{"strategy": "D"}]}, "strategy is 'D'; known: reference, A, B, C, K_prime"),
        ({"duration": "long"}, "duration: .* valid number"),
        ({"duration": 0.0}, "duration is 0"),
        ({"disc": {"rotation": 0.0}}, "a disc with defects has to turn"),
        ({"defects": [{"present": [0.4, 0.5]}]}, "defect 0, .* lies outside the record"),
        ({"shocks": [{"time": 0.3, "acceleration": 1.0}]}, r"shock at 0\.3 s lies outside"),
        ({"false_alarms": [[0.2, 0.4]]}, r"false alarm at 0\.4 s lies outside"),
        ({"stages": [{"strategy": "A", "time": 5.0}]}, r"stage at 5\.0 s lies outside"),
    ],
)
def test_scripts_that_are_none(changed, message):
    with pytest.raises(InputError, match=message):
        scenario(SCRIPT | changed)


def test_strategies_that_need_a_rotation():
    for name in "AB":
        still = Scenario(stages=(Stage(name),), duration=0.1)
        with pytest.raises(InputError, match=r"rotation frequency is 0\.0 Hz"):
            still.run()
    assert np.isfinite(replace(still, rotation=5.5, shocks=(Shock(0.05, 1.0),)).run().x).all()
    with pytest.raises(InputError, match="stages start at"):
        Scenario(stages=(Stage("reference", 0.05),), duration=0.1).run()


def test_files_that_are_none(tmp_path):
    with pytest.raises(InputError, match="scenario file"):
        read_scenario(tmp_path / "none.toml")
    path = tmp_path / "wrong.toml"
    path.write_text("duration = ")
    with pytest.raises(InputError, match=r"wrong\.toml"):
        read_scenario(path)


@pytest.mark.parametrize("quality", ["binary", "prompt"])
def test_a_quality_that_is_not_graded_is_0_or_1(quality):
    """The prompt one is 0 exactly where light is missing, and in the false alarm."""
    given = scenario(SCRIPT | {"quality": quality})
    record = given.run()
    seen, dimmed = record.signals["w_Q"], record.light < 1.0
    assert set(seen.tolist()) == {0.0, 1.0}
    (alarm,) = given.false_alarms
    false = (record.time >= alarm[0] - 1e-9) & (record.time < alarm[1] - 1e-9)
    assert (seen[false] == 0.0).all()
    if quality == "prompt":
        np.testing.assert_array_equal(seen == 0.0, dimmed | false)
    else:
        assert 0 < (seen[~false] == 0.0).sum() < 3 * dimmed.sum()
