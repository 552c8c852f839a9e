"""The examples, as a user runs them: in an empty folder, by the commands of their READMEs."""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(folder.name for folder in EXAMPLES.iterdir() if folder.is_dir())
PLANTS = {"magnetic_bearing": "magnetic-bearing", "two_mass_servo": "two-mass-servo"}


def run(*command: str, cwd: Path) -> str:
    """Output of a command, which has to end well."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=3000)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", NAMES)
def test_records_are_made_anew(name, tmp_path):
    run(sys.executable, str(EXAMPLES / name / "make_records.py"), cwd=tmp_path)
    files = sorted((tmp_path / "records").glob("*.csv"))
    assert len(files) >= 5
    for file in files:
        table = pd.read_csv(file)
        assert len(table) >= 2000
        assert np.isfinite(table.to_numpy()).all()


@pytest.mark.parametrize("name", NAMES)
def test_a_readme_names_what_is_there(name):
    text = (EXAMPLES / name / "README.md").read_text(encoding="utf-8")
    for file in re.findall(r"`(\w+\.py)`", text):
        assert (EXAMPLES / name / file).is_file(), file


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS)
def test_a_study_of_records_runs_to_the_code(name, tmp_path):
    plant = PLANTS[name]
    workbench = str(Path(sys.executable).with_name("workbench"))
    run(sys.executable, str(EXAMPLES / name / "make_records.py"), cwd=tmp_path)
    run(workbench, "init", plant, "--data", "records/*.csv", cwd=tmp_path)
    said = run(workbench, "run", f"{plant}/*", cwd=tmp_path / plant)
    assert said.count("holds") == 4
    assert list((tmp_path / plant / "results" / plant / "board").glob("*/controller.h"))
    peak = float(re.search(rf"{plant}/controller .*?peak ([\d.]+)", said).group(1))
    assert peak < 1.1  # derived from the records alone, and near what can be had


def test_the_way_from_records_to_code_takes_fifteen_lines():
    tree = ast.parse((EXAMPLES / "two_mass_servo" / "script.py").read_text(encoding="utf-8"))
    assert ast.get_docstring(tree)
    code = tree.body[1:]
    assert all(one.lineno == one.end_lineno for one in code)
    assert len(code) == 15


@pytest.mark.slow
def test_the_script_reaches_a_small_controller_that_is_proven(tmp_path):
    """Mu below 1 with four states, stable itself; and below 1 for the sampled set of plants."""
    run(sys.executable, str(EXAMPLES / "two_mass_servo" / "make_records.py"), cwd=tmp_path)
    said = run(sys.executable, str(EXAMPLES / "two_mass_servo" / "script.py"), cwd=tmp_path)
    peaks = [float(peak) for peak in re.findall(r"checks hold; peak ([\d.]+)", said)]
    assert len(peaks) == 2 and max(peaks) < 1, said
    assert "order 4, with an integrator, stable otherwise" in said
    assert (tmp_path / "controller.h").is_file()


@pytest.mark.slow
def test_the_tanks_have_a_controller_of_two_inputs(tmp_path):
    shutil.copytree(EXAMPLES / "coupled_tanks", tmp_path / "tanks")
    run(sys.executable, "make_records.py", cwd=tmp_path / "tanks")
    said = run(sys.executable, "design.py", cwd=tmp_path / "tanks")
    assert float(re.search(r"proven: ([\d.]+)", said).group(1)) < 1
    assert "pump 2: gain" in said
    assert (tmp_path / "tanks" / "controller.h").is_file()
