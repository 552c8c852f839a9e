"""Every public function and class of the reference has an example, and the examples run."""

import doctest
import importlib
import importlib.util
import inspect
import re
from pathlib import Path

import pytest
from surface.reading import reference

DOCS = Path(__file__).parents[2] / "docs"
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


REFERENCE = reference()


def session_of(room):
    """The code of a room's page of examples."""
    page = DOCS / "reference" / "examples" / f"{room}.md"
    return page.read_text(encoding="utf-8") if page.exists() else ""


def documented():
    """Room, name and object of every public function and class."""
    for room in REFERENCE.ROOMS:
        module = importlib.import_module(room)
        for name in REFERENCE.public_names(module):
            found = getattr(module, name)
            if REFERENCE.kind_of(found) in {"function", "class"}:
                yield room, name, found


def own_examples():
    """Objects whose docstring has an example, each once."""
    seen = {}
    for room, name, found in documented():
        if ">>>" in (inspect.getdoc(found) or ""):
            seen.setdefault(id(found), pytest.param(found, id=f"{room}.{name}"))
    return seen.values()


def test_every_public_name_has_an_example():
    without = [
        f"{room}.{name}"
        for room, name, found in documented()
        if ">>> " not in (inspect.getdoc(found) or "")
        and not re.search(rf"^(>>>|\.\.\.) .*\b{name}\b", session_of(room), re.MULTILINE)
    ]
    assert without == []


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("found", own_examples())
def test_example_of_a_name_runs(found, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = found.__name__
    test = doctest.DocTestParser().get_doctest(
        inspect.getdoc(found), {"__name__": "example"}, name, name, 0
    )
    assert any(re.search(rf"\b{name}\b", one.source) or one.want for one in test.examples)
    out = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    runner.run(test, out=out.append)
    assert runner.failures == 0, "".join(out)
