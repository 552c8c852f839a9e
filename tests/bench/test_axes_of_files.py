"""Problems for every file of a folder: the axis is a pattern, each instance hashes its own file."""

import json
import re

import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.bench.project import registry
from workbench.cli import main
from workbench.errors import InputError, UnknownNameError

SOURCE = '''
from pathlib import Path

from workbench import problem
from workbench.collections import read_sdpa
from workbench.conic import ConicProgram


@problem("sdplib/{instance}", instance="sdplib/*.dat-s", data="sdplib/{instance}.dat-s")
def sdplib(instance: str) -> ConicProgram:
    """Semidefinite programs of SDPLIB."""
    return read_sdpa(Path(__file__).parent / f"sdplib/{instance}.dat-s")
'''
LEAST = "1\n1\n-1\n1\n0 1 1 1 {}\n1 1 1 1 1\n"  # the least x with x >= a number


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A project with two instances; the folder of its files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("WORKBENCH_RESULTS", raising=False)
    (tmp_path / "pyproject.toml").write_text('[tool.workbench]\nproblems = ["mine"]\n')
    folder = tmp_path / "mine/sdplib"
    folder.mkdir(parents=True)
    (folder.parent / "programs.py").write_text(SOURCE)
    for name, number in (("arch0", 2), ("control1", 3)):
        (folder / f"{name}.dat-s").write_text(LEAST.format(number))
    return folder


def names():
    return [entry.name for entry in registry().match("*") if entry.name.startswith("sdplib/")]


def test_every_file_is_a_problem_and_a_new_one_is_found(files):
    assert names() == ["sdplib/arch0", "sdplib/control1"]
    (files / "theta1.dat-s").write_text(LEAST.format(5))
    assert names() == ["sdplib/arch0", "sdplib/control1", "sdplib/theta1"]
    (files / "arch0.dat-s").unlink()
    assert names() == ["sdplib/control1", "sdplib/theta1"]
    with pytest.raises(UnknownNameError, match="sdplib/arch0"):
        registry().find("sdplib/arch0")


def test_an_instance_hashes_its_own_file_only(files):
    runs = {name: wb.run(name) for name in names()}
    assert [run.metrics["value"] for run in runs.values()] == pytest.approx([2.0, 3.0])
    assert list(runs["sdplib/arch0"].info["data"]) == ["sdplib/arch0.dat-s"]
    (files / "control1.dat-s").write_text(LEAST.format(4))
    again = {name: wb.run(name) for name in names()}
    assert again["sdplib/arch0"].reused and not again["sdplib/control1"].reused
    assert again["sdplib/control1"].metrics["value"] == pytest.approx(4.0)
    assert wb.verify(again["sdplib/arch0"].path).holds


@pytest.mark.cases(0)
def test_a_comparison_takes_them_all(files):
    words = ["compare", "sdplib/*", "--methods", "clarabel,scs", "--accuracy", "low", "--json"]
    done = CliRunner().invoke(main, [*words, "--in-process"])
    assert done.exit_code == 0, done.output
    cells = json.loads(done.stdout)["cells"]
    assert len(cells) == 4 and {cell["verdict"] for cell in cells} == {"solved"}
    assert all(cell["gap"] not in ("", "-") for cell in cells)


def test_a_data_file_of_an_unknown_axis_is_an_error(files):
    text = SOURCE.replace('data="sdplib/{instance}.dat-s"', 'data="sdplib/{other}.dat-s"')
    (files.parent / "programs.py").write_text(text)
    with pytest.raises(InputError.__base__, match="needs an axis for 'other'"):
        wb.run("sdplib/arch0")


@pytest.mark.parametrize("pattern", ["sdplib/**.dat-s", "sdplib/arch0.dat-s"])
def test_a_pattern_has_one_star(files, pattern):
    text = SOURCE.replace('instance="sdplib/*.dat-s"', f'instance="{pattern}"')
    (files.parent / "programs.py").write_text(text)
    assert any("a pattern of files with one star" in sentence for sentence in registry().unfit)


COMPUTED = '''
from workbench import problem
from workbench.conic import ConicProgram

SIZES = ("small", "large")


def instances():
    return [f"n{k}" for k in (1, 2)]


@problem("mine/{size}/{instance}", size=SIZES, instance=instances)
def mine(size: str, instance: str) -> ConicProgram:
    """Programs of two sizes."""
'''


def mine():
    return [entry.name for entry in registry().match("mine/*")]


def test_an_axis_may_be_a_name_or_a_function_of_the_file(files):
    file = files.parent / "computed.py"
    file.write_text(COMPUTED)
    wanted = ["mine/large/n1", "mine/large/n2", "mine/small/n1", "mine/small/n2"]
    assert [entry.name for entry in registry().match("mine/*")] == wanted
    file.write_text(COMPUTED.replace("(1, 2)", "(3,)"))
    assert [entry.name for entry in registry().match("mine/*")] == [
        "mine/large/n3",
        "mine/small/n3",
    ]


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            "raise ValueError('no list')",
            r"instances\(\), .* axis, failed: ValueError",
        ),
        ("return 3", "axis instance must be a tuple of texts"),
        ("return ['a', 3]", "axis instance must be a tuple of texts"),
        ("return ['a b']", "is no problem name"),
    ],
)
def test_a_function_that_gives_no_texts_costs_its_own_names(files, body, words):
    source = COMPUTED.replace('return [f"n{k}" for k in (1, 2)]', body)
    (files.parent / "computed.py").write_text(source)
    assert names() == ["sdplib/arch0", "sdplib/control1"]
    (sentence,) = registry().unfit
    assert re.search(words, sentence)
