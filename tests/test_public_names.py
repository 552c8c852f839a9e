"""One public name, one meaning: no class or function is defined in two modules of the library."""

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1] / "workbench"
COMMANDS = {"compare", "report", "results", "run", "sweep", "verify"}
"""Commands of the command line are called as the functions of the Python face that they call."""


def definitions():
    """Modules that define each public class or function at their top level, by its name."""
    found = defaultdict(list)
    for file in sorted(ROOT.rglob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            named = isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
            if named and not node.name.startswith("_") and not _is_signature(node):
                found[node.name].append(file.relative_to(ROOT).as_posix())
    return found


def _is_signature(node):
    """Whether it is one of several signatures of a function, and defines nothing."""
    return any(isinstance(one, ast.Name) and one.id == "overload" for one in node.decorator_list)


def test_a_public_class_or_function_is_defined_once():
    twice = {name: files for name, files in definitions().items() if len(files) > 1}
    assert twice.keys() - COMMANDS == set(), twice
    for name in COMMANDS:
        assert any(place.startswith("cli/") for place in twice[name]) and len(twice[name]) == 2
