"""What a results folder holds, and how a run shows itself."""

import json
import math

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import workbench as wb
from workbench.bench.files import write_json
from workbench.bench.question import plain
from workbench.bench.results import open_run
from workbench.bench.store import CHECKSUMS, files
from workbench.bench.trust.untrusted import read_json
from workbench.errors import ResultError


@pytest.fixture
def run(project):
    return wb.run("toy/root", drawn=True)


@pytest.fixture
def total(project):
    """Its metrics hold an infinity and a NaN."""
    return wb.run("toy/total")


def test_the_folder_holds_what_it_should(run):
    assert files(run.path) == [
        "certificate.json",
        "data.nc",
        "log.txt",
        "metrics.json",
        "ro-crate-metadata.json",
        "run.json",
    ]
    lines = (run.path / CHECKSUMS).read_text().splitlines()
    assert [line.split("  ")[1] for line in lines] == files(run.path)


def test_checksums_are_written_last(run):
    times = {name: (run.path / name).stat().st_mtime_ns for name in files(run.path)}
    assert max(times.values()) <= (run.path / CHECKSUMS).stat().st_mtime_ns


def test_run_json_tells_the_question_who_answered_and_how_long_it_took(run):
    info = json.loads((run.path / "run.json").read_text())
    assert info["problem"] == "toy/root" and info["method"] == "exact"
    assert info["parameters"] == {"scale": 1.0, "copies": 1, "drawn": True}
    assert info["options"] == {"tolerance": 1e-6, "time_limit": None, "seed": 0}
    assert info["data"].keys() == {"targets.csv"} and len(info["data"]["targets.csv"]) == 64
    assert info["key"] == run.path.name
    assert (info["claim"], info["outcome"], info["kind"]) == ("solved", "solved", "program")
    assert info["versions"].keys() >= {"workbench", "python", "numpy", "cvxpy", "clarabel"}
    assert info["seconds"].keys() == {"statement", "solve", "check", "total"}
    assert info["started"] <= info["finished"] and info["platform"]


@pytest.mark.parametrize("name", ["run.json", "certificate.json", "metrics.json"])
def test_json_is_strict_even_with_infinite_metrics(total, name):
    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    json.loads((total.path / name).read_text(), parse_constant=refuse)


def test_nothing_in_the_folder_is_private_or_executable(run, project):
    for name in files(run.path):
        content = (run.path / name).read_bytes()
        assert str(project.root).encode() not in content, name
        assert not name.endswith((".pkl", ".pickle", ".py", ".npy"))


def test_arrays_are_labelled_with_units_and_complex_ones_are_pairs(run):
    with h5py.File(run.path / "data.nc") as raw:
        assert set(raw) == {"x", "target", "phasor_real", "phasor_imag"}
        assert raw["x"].attrs["units"] == b"m"
    x = run.data["x"].values
    assert np.array_equal(run.data["phasor"].values, x * np.exp(1j * x))


def test_the_same_run_gives_the_same_files(run):
    before = {
        name: (run.path / name).read_bytes()
        for name in files(run.path)
        if name.startswith(("cert", "metrics"))
    }
    again = wb.run("toy/root", drawn=True, fresh=True)
    assert before == {name: (again.path / name).read_bytes() for name in before}


def test_a_run_is_read_back_from_its_folder(run):
    again = open_run(str(run.path))
    assert again.certificate == run.certificate
    assert (again.problem, again.method, again.key) == ("toy/root", "exact", run.key)
    assert again.data.identical(run.data)
    assert again.headline == "largest 2"
    assert again.log.startswith("toy/root {'scale': 1.0")


@pytest.mark.cases(0)
def test_a_run_shows_itself(run):
    assert repr(run) == f"<Run toy/root by exact: solved, largest 2, {run.path}>"
    page = run._repr_html_()
    assert "optimality gap" in page and "reach" in page and run.key in page
    assert run.show()._repr_png_().startswith(b"\x89PNG")
    assert run.show("roots") == run.show()
    assert len(repr(run.show())) < 80  # not the bytes
    assert run.tables == {}


def test_the_answer_comes_back_as_the_method_gave_it(run):
    assert np.array_equal(run.answer, np.sqrt(run.task.targets))
    assert run.task.drawn


@pytest.mark.cases(0)
def test_figures_are_drawn_into_a_folder_of_ones_own(run, tmp_path):
    files = run.draw(tmp_path / "new" / "figures")
    assert [file.name for file in files] == ["roots.svg", "roots.png"]
    before = [file.read_bytes() for file in files]
    assert [file.read_bytes() for file in run.draw(tmp_path / "new" / "figures")] == before
    with pytest.raises(ResultError, match="sealed results folder"):
        run.draw(run.path / "figures")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultError, match="cannot write"):
        run.draw(tmp_path / "file" / "figures")


def test_a_run_whose_problem_is_gone_says_so(run, project):
    (project.root / "plants" / "toy" / "problems.py").unlink()
    with pytest.raises(ResultError, match="'toy/root' is not registered here"):
        run.show()
    assert run.data["x"].size


def test_a_figure_that_is_not_there_is_an_error(run):
    with pytest.raises(ResultError, match="no figure 'other' here; there are roots"):
        run.show("other")
    with pytest.raises(ResultError, match="has no figure"):
        wb.run("toy/root").show()


def test_metrics_without_a_value_are_numbers_again(total):
    assert total.metrics["share"] == math.inf
    assert math.isnan(total.metrics["hole"])


def test_metrics_without_a_value_are_shown(project, total):
    assert "total" in total.headline and "share" in total._repr_html_()
    project.edit('headline = "total"', 'headline = "share"')
    assert repr(wb.run("toy/total")).count("share inf") == 1


def test_results_are_listed_by_pattern(run, total):
    assert [one.problem for one in wb.results()] == ["toy/root", "toy/root", "toy/total"]
    assert [one.path for one in wb.results("*/total")] == [total.path]
    assert wb.results("nothing*") == []


def test_an_empty_project_has_no_results(project):
    assert wb.results() == []


@pytest.mark.parametrize("content", ["", "{", "[1", "\x00"])
def test_broken_json_is_a_clear_error(tmp_path, content):
    (tmp_path / "run.json").write_text(content)
    with pytest.raises(ResultError, match=r"run\.json is no JSON"):
        read_json(tmp_path / "run.json")


def test_what_is_no_results_folder_says_so(tmp_path):
    with pytest.raises(ResultError, match=r"is no results folder: it has no run\.json"):
        open_run(tmp_path)
    with pytest.raises(ResultError, match=r"metrics\.json is missing"):
        read_json(tmp_path / "metrics.json")


def test_json_is_written_for_people_and_diffs(tmp_path):
    write_json(tmp_path / "a.json", {"b": 1.5, "a": [math.nan, None], "c": [{"d": "é"}, {}]})
    text = """{
  "b": 1.5,
  "a": ["nan", null],
  "c": [
    {"d": "\\u00e9"},
    {}
  ]
}
"""
    assert (tmp_path / "a.json").read_text() == text


entries = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, width=64) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(st.text(), entries, max_size=3))
def test_json_reads_back_as_it_was_written(tmp_path_factory, content):
    file = tmp_path_factory.mktemp("json") / "a.json"
    write_json(file, content)
    assert json.loads(file.read_text()) == plain(content)
