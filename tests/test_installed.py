"""What helps who has just installed it: the command, doctor, cite, completion."""

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from packaging.requirements import Requirement

import robust_workbench
import workbench as wb
from workbench.cli import main
from workbench.cli.guidance import doctor
from workbench.cli.guidance.citation import OF_METHODS, citation, references
from workbench.errors import UnknownNameError

ROOT = Path(__file__).parents[1]


def test_the_version_names_the_project():
    said = CliRunner().invoke(main, ["--version"]).output
    assert said.startswith(f"robust-workbench {wb.__version__} (")
    assert str(Path(wb.__file__).parent) in said


def test_the_command_refuses_another_package_of_the_same_name(tmp_path):
    (tmp_path / "workbench").mkdir()
    (tmp_path / "workbench" / "__init__.py").write_text("")
    code = f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {str(ROOT)!r}]\n"
    code += "import robust_workbench; robust_workbench.main()"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True)
    assert done.returncode == 1
    assert str(tmp_path / "workbench") in done.stderr and "environment" in done.stderr


def test_the_command_says_that_nothing_is_there(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(SystemExit, match="no package"):
        robust_workbench.main()


def test_doctor_finds_versions_and_says_what_is_missing(monkeypatch):
    found = {one.topic: one for one in doctor.examination(test=False)}
    assert found["numpy"].well and int(found["problems"].found.split()[0]) > 150
    real = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "slycot" else real(name))
    found = {one.topic: one for one in doctor.examination(test=False)}
    assert not found["slycot"].well and "conda" in found["slycot"].advice


def test_doctor_tells_of_a_release_of_numba_that_was_not_tested(monkeypatch):
    found = {one.topic: one for one in doctor.examination(test=False)}["machine code"]
    assert found.well and found.found == "releases of Numba and llvmlite that were tested"
    monkeypatch.setattr("numba.__version__", "99.0")
    found = {one.topic: one for one in doctor.examination(test=False)}["machine code"]
    assert not found.well
    assert "numba 99.0 was not tested" in found.found and "results stay the same" in found.advice


def test_doctor_names_every_conic_solver_that_is_installed(monkeypatch):
    found = {one.topic: one for one in doctor.examination(test=False)}["conic solvers"]
    for name in doctor.SOLVERS:
        said = doctor.SOLVERS[name] in found.found
        assert said == (doctor._version(name) is not None)
    real = doctor._version
    monkeypatch.setattr(doctor, "_version", lambda name: None if name == "osqp" else real(name))
    missing = {one.topic: one for one in doctor.examination(test=False)}["conic solvers"]
    assert "OSQP" not in missing.found and "brings osqp" in missing.advice


def test_doctor_tells_two_distributions_of_one_import_name(monkeypatch):
    monkeypatch.setattr(doctor, "_version", lambda name: "1.0")
    twins = doctor._twins()
    assert not twins.well and "environment" in twins.advice


def test_doctor_tests_itself_and_keeps_nothing(project, monkeypatch):
    monkeypatch.setattr(doctor, "TESTS", (("roots", "toy/root", {}),))
    (said,) = doctor._self_test()
    assert said.well and "certificate holds" in said.found
    assert not wb.results()


def test_a_citation_has_software_thesis_and_methods():
    said = citation("cd/focus/circles")
    assert said.startswith("@software{") and "@phdthesis{vidal2003" in said
    assert "goulart2024" in citation("quick/cart/dwell")
    assert "vidal2003" not in citation("quick/cart/dwell")
    with pytest.raises(UnknownNameError):
        citation("no/such/problem")


def test_references_of_methods_are_in_the_bibliography():
    known = references()
    assert {key for keys in OF_METHODS.values() for key in keys} <= known.keys()
    assert len(known) > 25


def completed(*words, begun=""):
    shell = ShellComplete(main, {}, "workbench", "_WORKBENCH_COMPLETE")
    return [one.value for one in shell.get_completions(list(words), begun)]


def test_names_parameters_and_methods_are_completed():
    assert "cd/focus/stadiums" in completed("run", begun="cd/focus/sta")
    assert completed("run", "cd/focus/circles", "--set", begun="freq") == ["frequencies="]
    assert "exact" in completed("run", "cd/focus/circles", "--method", begun="e")
    assert completed("compare", "cd/focus/circles", "--methods", begun="exact,cla") == [
        "exact,clarabel"
    ]
    assert completed("run", "no/such", "--method", begun="e") == []


def test_the_recipe_of_conda_asks_for_what_the_wheel_asks_for():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = yaml.safe_load((ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == declared["version"]
    assert recipe["package"]["name"] == declared["name"]
    named = {"matplotlib": "matplotlib-base", "cvxpy": "cvxpy-base"}
    wanted = {
        f"{named.get(one.name, one.name)} {one.specifier}"
        for one in map(Requirement, declared["dependencies"])
    }
    run = set(recipe["requirements"]["run"])
    assert run == wanted | {f"python {declared['requires-python']}"}
