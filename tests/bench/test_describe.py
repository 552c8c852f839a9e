"""What a problem says of itself."""

import json

import pytest

from workbench.bench.describe import describe
from workbench.bench.project import registry


@pytest.fixture
def shown(project):
    return lambda name: describe(registry().find(name))


def test_help_parameters_data_and_methods_are_shown(shown):
    one = shown("toy/root")
    assert one.help.startswith("Least roots of the targets (table 1).\n\nscale:")
    assert one.parameters == {
        "scale": "number = 1.0",
        "copies": "integer = 1",
        "drawn": "true or false = False",
    }
    assert one.data == ("targets.csv",)
    assert one.methods["exact"] == "The square root. [claims the optimum] (default)"
    assert one.methods["rough"] == "Half again as large as it need be, and says nothing else."


def test_the_text_holds_all_of_it(shown):
    lines = [line.split() for line in shown("toy/root").text.splitlines()]
    assert lines[0] == ["toy/root"]
    assert ["scale", "number", "=", "1.0"] in lines
    assert ["targets.csv"] in lines
    assert ["picky", "Counts", "to", "three.", "[claims", "the", "optimum]"] in lines


def test_the_source_leads_to_the_function(project, shown, monkeypatch):
    source = shown("toy/root").source
    path, _, line = source.partition(":")
    assert path == "plants/toy/problems.py"
    assert project.toy.read_text().splitlines()[int(line) - 1].startswith("def root(")
    assert shown("toy/root").text.splitlines()[1] == source
    monkeypatch.chdir(project.root / "plants" / "toy")
    assert describe(registry().find("toy/root")).source == f"problems.py:{line}"


def test_a_source_elsewhere_is_absolute(project, shown, monkeypatch):
    problem = registry().find("toy/root")
    (project.root / "elsewhere").mkdir()
    monkeypatch.chdir(project.root / "elsewhere")
    assert describe(problem).source == f"{project.toy.resolve()}:{problem.entry.line}"


def test_it_is_json(shown):
    stored = json.loads(json.dumps(shown("toy/root").to_json()))
    assert stored["source"] == shown("toy/root").source
    assert stored["name"] == "toy/root"
    assert stored["slow"] is False


def test_a_study_has_no_methods_and_needs_are_no_parameters(shown):
    one = shown("toy/sum")
    assert one.methods == {}
    assert one.parameters == {"count": "integer = 2"}
    assert "methods" not in one.text


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("int", "integer, required"),
        ("float | None", "number | None, required"),
        ("Literal['u', 'v']", "'u' | 'v', required"),
        ("str", "string, required"),
        ("list[float]", "list of number, required"),
        ("Annotated[int, Field(ge=2)]", "integer >= 2, required"),
        ("bool", "true or false, required"),
    ],
)
def test_types_are_in_words_that_name_the_choices(project, shown, kind, words):
    project.write(
        "plants/p.py",
        "from __future__ import annotations\n"
        "from typing import Annotated, Literal\n"
        "from pydantic import Field\n"
        "from workbench import problem\n"
        f'@problem("p")\ndef f(value: {kind}): ...\n',
    )
    assert shown("p").parameters == {"value": words}
