"""Records that a newcomer gets wrong: the message names file, line and column, and what to do."""

import numpy as np
import pytest
from click.testing import CliRunner

from workbench.cli import main
from workbench.errors import InputError
from workbench.identification import read_record
from workbench.starter import write_study
from workbench.starter.first_look import oddities
from workbench.uncertainty import Responses

RATE, SAMPLES = 100.0, 600


def table(number):
    """Time [s], input and output (N, 3) of a first-order plant."""
    rng = np.random.default_rng(number)
    u, y = rng.standard_normal(SAMPLES), np.zeros(SAMPLES)
    for k in range(1, SAMPLES):
        y[k] = 0.9 * y[k - 1] + 0.1 * (1 + 0.05 * number) * u[k - 1]
    return np.column_stack([np.arange(SAMPLES) / RATE, u, y + 1e-4 * rng.standard_normal(SAMPLES)])


def write(folder, change, number=2, header="time,u,y"):
    """Three records, one of which is changed."""
    for k in (1, 2, 3):
        columns = change(table(k)) if k == number else table(k)
        form = {"delimiter": ",", "header": header, "comments": "", "fmt": "%.9g"}
        np.savetxt(folder / f"drive{k}.csv", columns, **form)


def refused(folder, change, number=2, header="time,u,y", **given):
    """The message for three records, one of which is changed."""
    write(folder, change, number, header)
    with pytest.raises(InputError) as refusal:
        write_study(folder / "servo", str(folder / "drive*.csv"), **given)
    assert not (folder / "servo").exists()
    return str(refusal.value)


def edited(row, column, value):
    def change(columns):
        columns[row, column] = value
        return columns

    return change


def gap(columns):
    return np.delete(columns, range(100, 104), axis=0)


def test_missing_rows_are_told_by_their_line(tmp_path):
    said = refused(tmp_path, gap, number=1)
    assert "drive1.csv: column 'time' looks like the time, but 1 of its 595 steps differ" in said
    assert "most at line 102: a step of 0.05 where the usual one is 0.01" in said
    assert "Interpolate" in said and "--sample-rate" in said


def test_missing_rows_of_a_later_file_too(tmp_path):
    said = refused(tmp_path, gap)
    assert "drive2.csv: variable 'time' is not equidistant" in said
    assert "line 102: a step of 0.05 where the usual one is 0.01" in said


def test_a_record_without_names_is_called_so_and_read_by_number(tmp_path):
    np.savetxt(tmp_path / "bare.csv", table(1), delimiter=",")
    with pytest.raises(InputError) as refusal:
        write_study(tmp_path / "servo", str(tmp_path / "bare.csv"))
    said = str(refusal.value)
    assert "bare.csv has numbers in its first line, line 1, and no names" in said
    assert "'1', '2', '3'" in said and "--input NAME" in said
    assert read_record(tmp_path / "bare.csv", ["2"], ["3"], time="1").sizes["time"] == SAMPLES


def test_a_blank_cell_is_told_by_its_line_and_column(tmp_path):
    said = refused(tmp_path, edited(40, 2, np.nan))
    assert "drive2.csv: variable 'y' has 1 entries that are blank, NaN or infinite" in said
    assert "the first at line 42: fill the gaps" in said


def test_lines_are_counted_with_comments_and_blank_rows(tmp_path):
    (tmp_path / "log.csv").write_text("# rig 3\nu,y\n1,2\n,\n3,4\n5,nan\n")
    with pytest.raises(InputError, match=r"'y' has 1 entries .* first at line 6"):
        read_record(tmp_path / "log.csv", ["u"], ["y"], dt=1 / 1.0)


@pytest.mark.parametrize("left", [20, 60])
def test_a_short_record_is_named_with_what_is_needed(tmp_path, left):
    said = refused(tmp_path, lambda columns: columns[:left])
    assert f"drive2.csv has {left} samples; 80 are needed at least" in said


@pytest.mark.parametrize(("column", "kind"), [(1, "input 'u'"), (2, "output 'y'")])
def test_a_constant_column_is_named(tmp_path, column, kind):
    said = refused(tmp_path, edited(slice(None), column, 0.5))
    assert f"drive2.csv: the {kind} never changes, it is 0.5 in all 600 samples" in said


@pytest.mark.cases(0)
def test_the_file_with_exchanged_columns_is_named(tmp_path):
    write(tmp_path, lambda columns: columns[:, [0, 2, 1]])
    names = {"input": "u", "output": "y", "time": "time", "hold": True}
    with pytest.raises(
        InputError, match=r"drive2\.csv: feedback: .* are input and output exchanged"
    ):
        Responses.from_files(tmp_path / "drive*.csv", **names)
    names["assume"] = "open loop"
    found = Responses.from_files(tmp_path / "drive*.csv", **names).within(0.0, 0.1 * RATE)
    (said,) = oddities(found, ["drive1.csv", "drive2.csv", "drive3.csv"])
    assert "the gain rises with frequency at the end in drive2.csv alone" in said
    assert "are input and output exchanged?" in said


def test_files_of_a_pattern_without_quotes_are_taken(tmp_path, monkeypatch):
    taken = []

    def write(folder, data, **given):
        taken.append((folder.name, data))
        raise InputError("enough")

    monkeypatch.setattr("workbench.starter.write_study", write)
    monkeypatch.chdir(tmp_path)
    files = [f"drive{k}.csv" for k in (1, 2, 3)]
    for file in files:
        (tmp_path / file).touch()
    for asked in (["servo", "--data", *files], ["--data", *files, "servo"]):
        CliRunner().invoke(main, ["init", *asked])
    CliRunner().invoke(main, ["init", "servo", "--data", "drive*.csv"])
    assert taken == [("servo", files), ("servo", files), ("servo", "drive*.csv")]
    two = CliRunner().invoke(main, ["init", "one", "two", "--data", "drive*.csv"])
    assert two.exit_code == 2
    assert "one new folder is needed, and 'one', 'two' is given" in two.output
