"""What a user gets: a wheel that works elsewhere, pinned requirements, a README that is true."""

import os
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-q"]
    subprocess.run([*command, "-w", folder, ROOT], check=True)
    return next(folder.glob("workbench-*.whl"))


def test_wheel_runs_a_named_problem_from_another_folder(wheel, tmp_path):
    installed, elsewhere = tmp_path / "installed", tmp_path / "elsewhere"
    elsewhere.mkdir()
    pip = [sys.executable, "-m", "pip", "install", "--no-deps", "-q", "--target", installed, wheel]
    subprocess.run(pip, check=True)
    environment = os.environ | {"PYTHONPATH": str(installed)}

    def workbench(*arguments):
        command = [sys.executable, "-P", "-m", "workbench", *arguments]
        return subprocess.run(
            command, cwd=elsewhere, env=environment, capture_output=True, text=True
        )

    assert "cd/focus/stadiums" in workbench("list").stdout
    done = workbench("run", "cd/focus/circles", "--set", "frequencies=5")
    assert done.returncode == 0, done.stderr
    assert "holds" in done.stdout
    assert list((elsewhere / "results").glob("cd/focus/circles/*/SHA256SUMS"))
    report = workbench("report")
    assert report.returncode == 0, report.stderr
    where = [sys.executable, "-P", "-c", "import workbench; print(workbench.__file__)"]
    out = subprocess.run(where, cwd=elsewhere, env=environment, capture_output=True, text=True)
    assert out.stdout.startswith(str(installed))


@pytest.mark.slow
def test_pip_install_in_an_empty_environment(tmp_path):
    venv.create(tmp_path / "env", with_pip=True)
    scripts = tmp_path / "env" / "bin"
    subprocess.run([scripts / "pip", "install", "-q", ROOT], check=True)
    command = [scripts / "workbench", "run", "cd/focus/stadiums", "--set", "frequencies=5"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_requirements_are_plain_pins():
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.]+", pin) for pin in pins)


def test_every_dependency_is_pinned_and_installed_at_its_pin():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"].values()
    wanted = [Requirement(t) for texts in [project["dependencies"], *extras] for t in texts]
    lines = (ROOT / "requirements.txt").read_text().splitlines()
    pins = dict(line.lower().split("==") for line in lines if "==" in line)
    for requirement in wanted:
        pinned = pins[requirement.name.lower()]
        assert requirement.specifier.contains(pinned), requirement


def test_links_of_the_readme_exist():
    text = (ROOT / "README.md").read_text()
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert links
    for link in links:
        assert (ROOT / link).exists(), link
