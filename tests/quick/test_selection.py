"""What `make quick` runs is what an edit can break."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from quick.chosen import FAR
from quick.edits import chosen, edited
from quick.graph import Graph
from quick.known_edits import known_edits, raising

ROOT = Path(__file__).parents[2]
EDITS = known_edits()
FEW = 0.25
"""Share of all test functions that most edits reach less than."""

each_edit = pytest.mark.parametrize("edit", EDITS, ids=":".join)
of_the_graph = pytest.mark.cases(0)
"""`make test` leaves these out: to read all sources takes six seconds of a processor."""


@pytest.fixture(scope="module")
def graph():
    return Graph(ROOT)


def chosen_of(graph, file, name):
    """What is chosen where a function raises an error that did not before."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return chosen(graph, edited(graph, {file: text.replace(f"def {name}(", "def before(", 1)}))


def test_there_are_edits_in_thirty_rooms():
    assert len({Path(file).parent for file, _ in EDITS}) >= 30


@of_the_graph
@each_edit
def test_what_an_edit_breaks_is_chosen(graph, edit):
    found = chosen_of(graph, *edit)
    assert [test for test in EDITS[edit] if found.distance(*test) is None] == []


@of_the_graph
def test_most_edits_reach_few_tests(graph):
    shares = sorted(
        sum(map(len, chosen_of(graph, *edit).tests.values())) / len(graph.tests) for edit in EDITS
    )
    assert shares[len(shares) // 2] < FEW


@of_the_graph
def test_a_function_of_an_upper_bound_is_followed_to_the_problems(graph):
    found = chosen_of(graph, "workbench/mu/upper/path.py", "follow")
    near = found.tests["tests/mu/test_upper.py"]
    far = found.tests["tests/problems/cd_drive/tolerance/test_lower_bandwidth.py"]
    assert min(near.values()) < min(far.values())
    assert "tests/optics/test_spots.py" not in found.tests


@of_the_graph
def test_a_comment_reaches_those_alone_that_read_sources(graph):
    file = "workbench/geometry/hull.py"
    text = (ROOT / file).read_text(encoding="utf-8")
    found = chosen(graph, edited(graph, {file: f"{text}# once more\n"}))
    assert set(found.tests["tests/test_house.py"].values()) == {FAR}
    assert "tests/geometry/test_hull.py" not in found.tests


@of_the_graph
@pytest.mark.parametrize(
    ("file", "test"),
    [
        ("workbench/bench/report/templates/page.css", "tests/bench/report/test_single_page.py"),
        ("workbench/starter/templates/README.md.j2", "tests/starter/test_study_folder.py"),
        ("docs/coming-from/documented-examples.md", "tests/docs/test_code_of_pages.py"),
        ("docs/coming-from/dkpy.md", "tests/docs/test_coming_from_pages.py"),
        ("workbench/_core/coming_from/dkpy.toml", "tests/_core/test_coming_from.py"),
        ("results/reference/cd/focus/nyquist/0/data.nc", "tests/test_reference.py"),
        ("examples/two_mass_servo/README.md", "tests/examples/test_examples.py"),
        ("tests/lanes.py", "tests/bench/test_fuzz.py"),
        ("tests/conftest.py", "tests/optics/test_spots.py"),
        ("requirements.txt", "tests/optics/test_spots.py"),
    ],
)
def test_files_of_other_kinds_reach_what_reads_them(graph, file, test):
    assert test in chosen(graph, edited(graph, {file: ""})).tests


@of_the_graph
def test_cases_are_told_apart_by_the_problem_that_they_are_about(graph):
    found = chosen_of(graph, "workbench/optics/layers.py", "_fields")
    place = "tests/test_reference.py", "test_reference_result_is_verified"
    assert found.distance(*place, "cd/focus-error/0a1b2c3d") is None
    assert found.distance(*place, "cd/radial-error/0a1b2c3d") == FAR


@pytest.fixture
def copy(tmp_path):
    """A copy of the sources in a folder of its own."""
    for folder in ("workbench", "problems", "tests", "docs"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("*.nb?"))
    for file in ("pyproject.toml", "robust_workbench.py"):
        shutil.copy(ROOT / file, tmp_path)
    (tmp_path / "results").symlink_to(ROOT / "results")
    return tmp_path


def failed(copy, tests):
    """Which of some tests fail in a copy, whose sources the processes of a test see too."""
    names = [f"{file}::{test}" for file, test in tests]
    words = ["-m", "pytest", "-q", "-n0", "-m", "not slow", "-p", "no:cacheprovider", *names]
    done = subprocess.run(
        [sys.executable, *words],
        cwd=copy,
        env=os.environ | {"PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
    )
    assert done.returncode in (0, 1), done.stdout + done.stderr
    return [
        (file, test)
        for file, test in tests
        if re.search(rf"^(FAILED|ERROR) {file}::{test}\b", done.stdout, re.MULTILINE)
    ]


@pytest.mark.slow
@each_edit
def test_the_tests_named_fail_with_the_edit(edit, copy):
    file, name = edit
    text = (ROOT / file).read_text(encoding="utf-8")
    (copy / file).write_text(raising(text, name), encoding="utf-8")
    assert failed(copy, EDITS[edit]) == EDITS[edit]


@pytest.mark.slow
def test_the_tests_named_pass_without_an_edit(copy):
    assert failed(copy, sorted({test for tests in EDITS.values() for test in tests})) == []
