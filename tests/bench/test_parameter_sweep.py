"""A problem over a grid of its parameters: points, dataset, what is found again, bad input."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.bench.parameter_sweep import ParameterSweep, SweptPoint, sweep_dataset
from workbench.cli import main
from workbench.errors import InputError, UnknownNameError


@pytest.mark.cases(0)
def test_points_are_runs_and_the_dataset_has_their_metrics(project):
    done = wb.sweep("toy/root", {"scale": [1, 4, 9], "copies": [1, 2]})
    assert done.holds and done.metrics == {"certified_share": 1.0, "points": 6.0}
    data = done.data
    assert data["outcome"].dims == ("scale", "copies")
    assert data["scale"].values.tolist() == [1.0, 4.0, 9.0]
    one = wb.run("toy/root", scale=4.0, copies=2)
    assert one.reused and one.key == data["key"].sel(scale=4.0, copies=2).item()
    for name, value in one.metrics.items():
        assert data[name].sel(scale=4.0, copies=2).item() == value
    assert wb.verify(done.path).holds
    assert set(done.tables) == {"points"} and set(done.figures) == {"metric"}


def test_what_is_stored_is_found_again(project):
    wb.sweep("toy/root", {"scale": [1, 4]})
    before = {run.key: run.info["started"] for run in wb.results("toy/root")}
    wb.sweep("toy/root", {"scale": [1, 4, 9]})
    after = {run.key: run.info["started"] for run in wb.results("toy/root")}
    assert len(after) == 3 and before.items() <= after.items()


def test_a_point_that_fails_costs_itself(project):
    done = wb.sweep("toy/root", {"scale": [-1, 4]}, method="exact")
    data = done.data
    assert not done.holds and done.metrics["certified_share"] == 0.5
    assert data["outcome"].sel(scale=4.0) == "solved"
    assert data["message"].sel(scale=-1.0).item()
    assert wb.verify(done.path).path == done.path


@pytest.mark.slow
def test_the_executor_makes_no_difference(project):
    grid = {"scale": [1, 4], "copies": [1, 2]}
    here = wb.sweep("toy/root", grid, fresh=True).data
    with ThreadPoolExecutor(2) as executor:
        there = wb.sweep("toy/root", grid, executor=executor, fresh=True).data
    apart = wb.sweep("toy/root", grid, jobs=2, fresh=True).data
    for name in set(here.data_vars) - {"seconds"}:
        for other in (there, apart):
            np.testing.assert_array_equal(here[name], other[name], err_msg=name)


@pytest.mark.cases(0)
def test_a_sweep_that_disagrees_with_its_points_does_not_verify(project):
    done = wb.sweep("toy/root", {"scale": [1, 4]})
    point = wb.run("toy/root", scale=4.0)
    wb.run("toy/root", scale=4.0, fresh=True)
    assert wb.verify(done.path).holds
    file = point.path / "run.json"
    file.write_text(file.read_text().replace('"outcome": "solved"', '"outcome": "failed"'))
    found = wb.verify(done.path)
    assert not found.holds and "the sweep says solved" in " ".join(found.problems)


@pytest.mark.parametrize(
    ("over", "given", "error", "message"),
    [
        ({}, {}, InputError, "needs a parameter and its values"),
        ({"scael": [1]}, {}, UnknownNameError, "scale"),
        ({"scale": []}, {}, InputError, "a list of one value or more"),
        ({"scale": "12"}, {}, InputError, "a list of one value or more, not '12'"),
        ({"scale": [1, 1.0]}, {}, InputError, "a value twice: 1.0, 1.0"),
        ({"scale": ["x"]}, {}, InputError, "scale='x' does not fit"),
        ({"scale": [1]}, {"scale": 2}, InputError, "swept and has a value of its own"),
        ({"scale": [1]}, {"copies": "x"}, InputError, "copies='x' does not fit"),
    ],
)
def test_bad_grids(project, over, given, error, message):
    with pytest.raises(error, match=message):
        wb.sweep("toy/root", over, **given)
    assert wb.results() == []


@pytest.mark.cases(0)
def test_the_command(project):
    project.restart()
    words = ["sweep", "toy/root", "--over", "scale=1,4", "--over", "copies=1,2"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "certified 4 of 4" in done.stdout and "|     4 |      2 |" in done.stdout
    told = json.loads(CliRunner().invoke(main, [*words, "--json"]).stdout)
    assert [point["scale"] for point in told["points"]] == [1.0, 1.0, 4.0, 4.0]
    twice = CliRunner().invoke(main, [*words, "--over", "scale=9"])
    assert twice.exit_code == 2 and "names a parameter twice" in twice.stderr
    assert CliRunner().invoke(main, ["sweep", "toy/root", "--over", "scale=-1"]).exit_code == 1


def test_metrics_that_are_called_like_a_variable_keep_apart():
    points = {(0,): SweptPoint("solved", metrics={"seconds": 3.0, "x": 4.0}, headline="x")}
    data = sweep_dataset({"x": [1]}, points, "p")
    assert data["metric_seconds"].item() == 3.0 and data["metric_x"].item() == 4.0
    assert np.isnan(data["seconds"].item())


def test_a_figure_of_words_and_of_many_lines():
    points = {
        (i, j): SweptPoint("solved", holds=True, metrics={"y": float(i + j)}, headline="y")
        for i in range(3)
        for j in range(10)
    }
    data = sweep_dataset({"kind": ["a", "b", "c"], "n": list(range(10))}, points, "p")
    panel = ParameterSweep.stored().figures(data)["metric"].axes[0]
    assert [tick.get_text() for tick in panel.get_xticklabels()] == ["a", "b", "c"]
    assert len(panel.lines) == 10


def test_a_plan_says_what_would_run_and_runs_nothing(project):
    words = ["sweep", "toy/root", "--over", "scale=1,4,9", "--plan", "--json"]
    wb.sweep("toy/root", {"scale": [4]})
    before = {run.key for run in wb.results("toy/root")}
    planned = json.loads(CliRunner().invoke(main, words).output)
    assert planned == [
        {"scale": 1.0, "state": "would run"},
        {"scale": 4.0, "state": "stored"},
        {"scale": 9.0, "state": "would run"},
    ]
    assert {run.key for run in wb.results("toy/root")} == before
    told = CliRunner().invoke(main, words[:-1])
    assert told.exit_code == 0 and "2 of 3 would run" in told.output
    fresh = json.loads(CliRunner().invoke(main, [*words, "--fresh"]).output)
    assert {one["state"] for one in fresh} == {"would run"}
