"""Problem folders and results: the project's, the command line's, the environment's."""

import pytest

import workbench as wb
from workbench.bench import project as here
from workbench.bench.project import Project
from workbench.errors import RegistryError, UnknownNameError

ONE = 'from workbench import problem\n@problem("{}")\ndef f():\n    """Help."""\n'


def names():
    return {entry.name for entry in wb.problems()}


def test_the_problems_of_workbench_and_project_are_found(project):
    assert {"cd/focus/circles", "toy/root"} <= names()


def test_the_project_is_the_nearest_folder_above_with_a_table(project, monkeypatch):
    inner = project.write("deep/down/pyproject.toml", "[project]\nname = 'other'\n").parent
    monkeypatch.chdir(inner)
    assert "toy/root" in names()
    assert here.results_root() == project.results
    project.write("deep/down/pyproject.toml", '[tool.workbench]\nresults = "kept"\n')
    assert "toy/root" not in names()
    assert here.results_root() == inner / "kept"


def test_without_a_project_results_stand_in_the_folder(tmp_path):
    assert Project.around(tmp_path) == Project((), tmp_path / "results")


def test_a_folder_is_added_once_and_stays(project):
    project.write("mine/p.py", ONE.format("mine/a"))
    for folder in ("mine", project.root / "mine", "mine/../mine"):
        wb.add_problems(folder)
    assert {"mine/a", "toy/root"} <= names()
    assert here.added_problems() == (project.root / "mine",)


def test_the_same_folder_named_twice_is_no_duplicate(project):
    wb.add_problems("plants")
    assert "toy/root" in names()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[tool.workbench]\nproblems = ["gone"]\n', "gone does not exist"),
        ("[tool.workbench\n", r"pyproject\.toml: "),
        ('[tool.workbench]\nproblems = "plants"\n', r"pyproject\.toml"),
        ("[tool.workbench]\nproblems = [3]\n", "must be a list of folders"),
        ("[tool.workbench]\nresults = 3\n", "results must be a folder"),
        ('[tool.workbench]\nresults = "a\\u0000b"\n', "results must be a folder"),
        ("[tool]\nworkbench = 3\n", "must be a table"),
        ("a = " + "[" * 3000, r"pyproject\.toml: "),
    ],
    ids=[
        "missing folder",
        "no TOML",
        "text for a list",
        "number for a folder",
        "number for the results",
        "NUL",
        "number for the table",
        "too deep",
    ],
)
def test_a_bad_project_file_is_a_clear_error(project, text, words):
    project.write("pyproject.toml", text)
    with pytest.raises(RegistryError, match=words):
        names()


def test_an_added_folder_must_exist(project):
    with pytest.raises(RegistryError, match="nowhere does not exist"):
        wb.add_problems("nowhere")


def test_the_results_folder_may_be_set_for_this_process_and_its_children(project):
    here.use_results("elsewhere")
    code = "from workbench.bench.project import results_root; print(results_root())"
    assert project.python(code) == str(project.root / "elsewhere") == str(here.results_root())


def test_a_broken_file_costs_its_own_names_only(project):
    project.write("plants/bad.py", "@problem('x'\n")
    assert wb.run("toy/root").holds
    with pytest.raises(RegistryError, match=r"no problem is called 'x'.*bad\.py:1"):
        wb.run("x")


def test_a_clash_costs_its_own_name_only(project):
    text = "from workbench import problem\n\n@problem('toy/root')\ndef f(): ...\n"
    project.write("plants/other.py", text)
    assert "toy/root" not in names() and "toy/x/root" in names()
    with pytest.raises(
        RegistryError, match=r"two problems are called 'toy/root': .*other.* and .*toy"
    ):
        wb.run("toy/root")


def test_a_name_outside_the_project_is_unknown(project, monkeypatch, tmp_path_factory):
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    with pytest.raises(UnknownNameError):
        wb.run("toy/root")
