"""Commands of an installed wheel in an empty folder: what is wrong is said, whatever it is."""

import json

import control
import numpy as np
import pytest

CIRCLES = "cd/focus/circles"
COMPARE = ["compare", CIRCLES, "--methods", "exact"]
SWEEP = ["sweep", CIRCLES, "--over"]

REFUSED = {
    "report": {
        "is no folder": ["report", "nowhere"],
        "has no results below it": ["report", "records"],
        "records/ok1.csv is no folder": ["report", "records/ok1.csv"],
        "records is no results folder": ["report", "--single-file", "records"],
        "leave ROOT out": ["report", "x", "--single-file", "records"],
        "cannot write the report": ["report", "--output", "records/ok1.csv"],
        "0 is not in the range": ["report", "--jobs", "0"],
    },
    "compare": {
        "name --methods": ["compare", CIRCLES],
        "no problem is called 'nope/*'": ["compare", "nope/*", "--all-methods"],
        "no method is called 'nope'": ["compare", CIRCLES, "--methods", "nope"],
        "nothing to compare: cd/red-book": ["compare", "cd/red-book", "--all-methods"],
        "not ['wild']": [*COMPARE, "--accuracy", "wild"],
        "--set needs KEY=VALUE": [*COMPARE, "--set", "frequencies"],
        "should be a finite number": [*COMPARE, "--set", "lowest=inf"],
        "time_limit must be positive [s], not nan": [*COMPARE, "--time-limit", "nan"],
        "a size is a number": [*COMPARE, "--memory-limit", "4x"],
        "cells are written to .csv": [*COMPARE, "--cells", "x.doc"],
        "the folder nodir": [*COMPARE, "--cells", "nodir/x.csv"],
        "nowhere is no results folder": [*COMPARE, "--against", "nowhere"],
        "--plan runs nothing": [*COMPARE, "--plan", "--cells", "x.csv"],
    },
    "sweep": {
        "Missing option '--over'": ["sweep", CIRCLES],
        "--over needs KEY=A,B,C, not 'frequencies'": [*SWEEP, "frequencies"],
        "--over needs KEY=A,B,C, not '=2'": [*SWEEP, "=2"],
        "did you mean frequencies?": [*SWEEP, "frequency=2,3"],
        "has a value twice": [*SWEEP, "frequencies=2,2"],
        "names a parameter twice": [*SWEEP, "frequencies=2", "--over", "frequencies=3"],
        "leave out one": [*SWEEP, "frequencies=2", "--set", "frequencies=3"],
        "lowest='nan' does not fit": [*SWEEP, "lowest=5,nan"],
        "lowest='inf' does not fit": [*SWEEP, "lowest=inf"],
        "must lie between 0 and 1, not nan": [*SWEEP, "frequencies=2", "--tolerance", "nan"],
        "must be positive [s], not -1.0": [*SWEEP, "frequencies=2", "--time-limit", "-1"],
    },
    "init": {
        "Missing option '--data'": ["init", "x"],
        "no file fits 'nope*.csv'": ["init", "x", "--data", "nope*.csv"],
        "the name of the files is empty": ["init", "x", "--data", ""],
        "records exists already": ["init", "records", "--data", "records/ok*.csv"],
        "'9x' names the plant": ["init", "9x", "--data", "records/ok*.csv"],
        "one new folder is needed": ["init", "x", "y", "--data", "records/ok*.csv"],
        "1 entries that are blank, NaN or infinite": ["init", "x", "--data", "records/nan*.csv"],
        "inf1.csv: variable 'y' has 1 entries": ["init", "x", "--data", "records/inf*.csv"],
        "allnan1.csv: variable 'y' has": ["init", "x", "--data", "records/allnan*.csv"],
        "1 of its": ["init", "x", "--data", "records/gap*.csv"],
        "never changes": ["init", "x", "--data", "records/still*.csv"],
        "the records tell of 0 common frequencies": ["init", "x", "--data", "records/noise*.csv"],
        "take a longer record": ["init", "x", "--data", "records/short*.csv"],
        "holds no numbers": ["init", "x", "--data", "records/empty*.csv"],
        "is the only file": ["init", "x", "--data", "records/ok1.csv"],
        "--period is nan": ["init", "x", "--data", "records/ok*.csv", "--period", "nan"],
        "--delay is -1.0": ["init", "x", "--data", "records/ok*.csv", "--delay", "-1"],
        "--delay is nan": ["init", "x", "--data", "records/ok*.csv", "--delay", "nan"],
        "--delay is inf": ["init", "x", "--data", "records/ok*.csv", "--delay", "inf"],
        "--sample-rate is 0.0": ["init", "x", "--data", "records/ok*.csv", "--sample-rate", "0"],
        "100 Hz, and --sample-rate": [
            *("init", "x", "--data", "records/ok*.csv", "--sample-rate", "50")
        ],
        "'u' is named as the input and": [
            *("init", "x", "--data", "records/ok*.csv", "--input", "u", "--output", "u")
        ],
    },
}
"""Words of each command that are refused, by what is said of them."""

ASK = """
import json, sys
from click.testing import CliRunner
from workbench.cli import main

for words in json.loads(sys.argv[1]):
    done = CliRunner().invoke(main, words)
    print(json.dumps([done.exit_code, done.output, repr(done.exception)]))
"""


@pytest.fixture
def records(tmp_path):
    """Records of plants, good ones and bad ones, in the folder where the commands run."""
    rng, time = np.random.default_rng(64), 0.01 * np.arange(600)
    u = rng.standard_normal(time.size)
    outputs = [
        control.forced_response(control.tf([8 + k], [1, 9]), time, u).outputs for k in (1, 2)
    ]

    def write(name, change=lambda time, u, y: None):
        for k, output in enumerate(outputs, start=1):
            columns = [time.copy(), u.copy(), output.copy()]
            change(*columns)
            content = np.column_stack(columns)[: 5 if name == "short" else None]
            file = tmp_path / "records" / f"{name}{k}.csv"
            np.savetxt(file, content, delimiter=",", header="time,u,y", comments="")

    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "empty1.csv").write_text("")
    write("ok")
    write("short")
    write("nan", lambda time, u, y: y.__setitem__(5, np.nan))
    write("inf", lambda time, u, y: y.__setitem__(5, np.inf))
    write("allnan", lambda time, u, y: y.__setitem__(slice(None), np.nan))
    write("gap", lambda time, u, y: time.__setitem__(7, np.nan))
    write("still", lambda time, u, y: u.__setitem__(slice(None), 1.0))
    write("noise", lambda time, u, y: y.__setitem__(slice(None), rng.standard_normal(y.size)))


@pytest.mark.cases(0)
@pytest.mark.parametrize("command", REFUSED)
def test_whatever_is_wrong_is_said_in_a_sentence(command, records, elsewhere, tmp_path):
    before = {path for path in tmp_path.iterdir() if path.name != "results"}
    asked = REFUSED[command]
    answers = elsewhere("-c", ASK, json.dumps(list(asked.values()))).splitlines()
    for (said, words), answer in zip(asked.items(), answers, strict=True):
        code, output, error = json.loads(answer)
        assert code == 2 and said in output, (words, output, error)
    assert {path for path in tmp_path.iterdir() if path.name != "results"} == before
