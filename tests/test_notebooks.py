"""Notebooks are executed, in a results folder of their own."""

import ast
import importlib
import inspect
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

import workbench as wb
from workbench.bench.project import registry

OPTIONS = set(inspect.signature(wb.run).parameters)
"""Keywords of ``wb.run`` that are not parameters of a problem."""

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_what_a_notebook_names_is_there(path):
    """Its imports, and the problems and parameters that it runs: what most often breaks."""
    cells = [
        cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"
    ]
    lines = [line for cell in cells for line in cell.splitlines() if not line.startswith("%")]
    tree = ast.parse("\n".join(lines))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, name.name) for name in node.names), ast.unparse(node)
        elif isinstance(node, ast.Import):
            for name in node.names:
                importlib.import_module(name.name)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "wb.run":
            name = node.args[0]
            if isinstance(name, ast.Constant):
                problem = registry().find(name.value)
                given = {word.arg for word in node.keywords if word.arg} - OPTIONS
                assert given <= set(problem.parameters), ast.unparse(node)


@pytest.mark.slow  # what they run is at full size
@pytest.mark.filterwarnings("default")  # of the notebook client's own event loop
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs(path, tmp_path, monkeypatch):
    monkeypatch.setenv("WORKBENCH_RESULTS", str(tmp_path))
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "commit it without outputs"
    client = NotebookClient(notebook, timeout=300, resources={"metadata": {"path": path.parent}})
    client.execute()
    shown = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {})
    ]
    assert shown, "a notebook shows a figure"
