"""What contributors read is true: its examples run in one project, its map is current."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import workbench as wb
from workbench.cli import main

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PAGE = (ROOT / "docs" / "how-to" / "extend.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
MOST_LINES = {"method": 15, "study": 25}
"""Lines of an example that are neither blank nor the name of its file: of a Study, of any other."""


COMMANDS = [
    (number, line)
    for number, (language, text) in enumerate(BLOCKS)
    if language == "sh"
    for line in text.splitlines()
]


def written(project, blocks):
    """Write the files of some blocks, in their order."""
    for language, text in blocks:
        if language != "sh":
            project.write(text.partition("\n")[0].removeprefix("# "), text)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("number", "line"), COMMANDS, ids=[line for _, line in COMMANDS])
def test_a_command_ends_well_where_the_page_has_come_so_far(number, line, project):
    written(project, BLOCKS[:number])
    if line == "workbench report":
        run("workbench run servo/x/nominal", project)
    run(line, project)
    finished = {run.problem: run for run in wb.results()}
    if line.startswith("workbench run"):
        assert line.split()[2] in finished
    assert all(run.holds for run in finished.values())


def test_the_commands_are_those_of_the_page():
    ran = [line.split()[0] for _, line in COMMANDS]
    assert ran.count("workbench") >= 4 and ran.count("pytest") == 1


def test_the_study_of_the_page_is_right(project):
    written(project, BLOCKS)
    jw = 1j * np.geomspace(100.0, 1e4, 10_000)
    peak = abs(1 / (1 + 1.2 * 300.0 / jw * np.exp(-1e-3 * jw))).max()
    assert wb.run("servo/y/loops").metrics["worst_peak"] == pytest.approx(peak, rel=1e-3)


def run(line, project):
    """Run a command of the page in the project, which must end well; returns its name."""
    command, *words = line.split()
    if command == "pytest":
        words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
        done = subprocess.run(words, cwd=project.root, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
    else:
        assert command == "workbench", line
        project.restart()
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, (line, result.output, result.exception)
    return command


@pytest.mark.parametrize("text", [text for language, text in BLOCKS if language == "python"])
def test_examples_are_short(text):
    name, *lines = text.splitlines()
    assert re.fullmatch(r"# [\w/]+\.py", name)
    kind = "study" if "(Study)" in text else "method"
    assert len([line for line in lines if line.strip()]) <= MOST_LINES[kind]


def test_examples_are_formatted(tmp_path):
    for number, (language, text) in enumerate(BLOCKS):
        if language == "python":
            (tmp_path / f"example_{number}.py").write_text(text, encoding="utf-8")
    for words in (["check"], ["format", "--check"]):
        command = [sys.executable, "-m", "ruff", *words, "--config", ROOT / "pyproject.toml"]
        done = subprocess.run([*command, tmp_path], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout


def test_the_map_is_the_house(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs" / "_tools")
    import house

    drawn = house.PICTURE.read_text(encoding="utf-8")
    assert drawn == house.drawn(), "draw it anew: python docs/_tools/house.py"


def test_files_and_links_exist():
    reading = (ROOT / "docs" / "reference" / "reading.md").read_text(encoding="utf-8")
    for file in re.findall(r"^\d\. `([\w/.]+)`", reading, re.MULTILINE):
        assert (ROOT / file).is_file(), file
    for link in re.findall(r"\]\(([^)#]+)\)", TEXT):
        assert (ROOT / link).exists(), link


def test_targets_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.findall(r"^    make ([a-z-]+)", TEXT, re.MULTILINE)
    assert len(targets) == 12
    assert all(
        re.search(rf"^([\w -]+ )?{target}( [\w -]+)?:", makefile, re.M) for target in targets
    )
