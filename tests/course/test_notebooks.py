"""The notebooks of the course: what they promise is there, they run and say what they said."""

import ast
import importlib
import inspect
import json
import re
from pathlib import Path

import nbformat
import pytest
from tables import each

import workbench as wb
from workbench.bench.project import registry
from workbench.course import notebook_files
from workbench.course.execution import (
    SOLUTION,
    code_of_solutions,
    executed,
    output_differences,
    stale,
    tagged,
)

OPTIONS = set(inspect.signature(wb.run).parameters)
"""Keywords of ``wb.run`` that are not parameters of a problem."""
LARGEST = 200_000
"""Size [bytes] of a notebook with its outputs."""
EXERCISES, QUESTIONS = 5, 3
"""Least numbers of exercises and of questions."""
QUICK = {"01_tour"}
"""What `make test` runs; all of them are run by `make test-all`."""

NOTEBOOKS = notebook_files()
each_notebook = each("path", NOTEBOOKS, ids=lambda path: path.stem)


def read(path):
    return nbformat.read(path, as_version=4)


def prose(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "markdown"]


def code(notebook):
    """All code, that of solutions too."""
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    lines = "\n".join([*cells, *code_of_solutions(notebook)]).splitlines()
    return "\n".join(line for line in lines if not line.startswith("%"))


@pytest.mark.cases(0)
@each_notebook
def test_what_a_notebook_names_is_there(path):
    """Its imports, and the problems and parameters that it runs: what most often breaks."""
    for node in ast.walk(ast.parse(code(read(path)))):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            for name in node.names:
                if not hasattr(module, name.name):
                    importlib.import_module(f"{node.module}.{name.name}")
        elif isinstance(node, ast.Import):
            for name in node.names:
                importlib.import_module(name.name)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "wb.run":
            name = node.args[0]
            if isinstance(name, ast.Constant) and name.value in registry().entries:
                problem = registry().find(name.value)
                given = {word.arg for word in node.keywords if word.arg} - OPTIONS
                assert given <= set(problem.parameters), ast.unparse(node)


@each_notebook
def test_a_notebook_is_a_lesson(path):
    """Aims, predictions, exercises and questions with hidden answers, further reading."""
    notebook = read(path)
    text = "\n".join(cell.source for cell in prose(notebook))
    assert "**You will be able to**" in text
    assert text.count("**Predict.**") >= 2
    assert "**Second way" in text
    assert "## Further reading" in text
    exercises, questions = text.split("## Exercises")[1].split("## Check your understanding")
    asked = re.findall(r"^\*\*\d+ \(.+?\)\.\*\*", exercises, re.MULTILINE)
    assert len(asked) >= EXERCISES and "(open)" in asked[-1]
    assert exercises.count("<details><summary>") == len(asked)
    assert questions.count("<details><summary>Answer") >= QUESTIONS
    assert len(code_of_solutions(notebook)) >= EXERCISES - 1
    for cell in prose(notebook):
        assert tagged(cell, SOLUTION) == ("<details>" in cell.source)
    pictures = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {})
    ]
    assert len(pictures) >= 3


@each_notebook
def test_outputs_are_small_and_those_of_the_code(path):
    notebook = read(path)
    assert path.stat().st_size < LARGEST
    assert not stale(notebook), "its code changed since it was run: make notebooks"
    said = json.dumps([cell.get("outputs", []) for cell in notebook.cells])
    assert '"output_type": "error"' not in said and "Warning" not in said
    assert str(Path.home()) not in said and "/tmp/" not in said


def test_code_that_changed_makes_outputs_stale():
    notebook = read(NOTEBOOKS[0])
    next(cell for cell in notebook.cells if cell.cell_type == "code").source += "\n1 + 1"
    assert stale(notebook)


@pytest.mark.filterwarnings("default")  # of the notebook client's own event loop
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=() if path.stem in QUICK else pytest.mark.slow, id=path.stem)
        for path in NOTEBOOKS
    ],
)
def test_a_notebook_runs_with_its_solutions_and_says_what_it_said(path, tmp_path, monkeypatch):
    monkeypatch.setenv("WORKBENCH_RESULTS", str(tmp_path / "results"))
    kept = read(path)
    made = executed(kept, tmp_path, solutions=True)
    assert not output_differences(kept, made)
