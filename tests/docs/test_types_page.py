"""The page of types names every class that means the same as another, and functions that exist."""

import importlib
import inspect
import re
import sys
from pathlib import Path

import pytest
from surface.reading import reference

PUBLIC_OF_A_MEANING = {"UncertainSystem", "Structure", "Peak", "LoopMargins"}
"""Public types that head a table, and so have no row."""
DOCS = Path(__file__).parents[2] / "docs"
MEANINGS = (
    "A linear system",
    "A frequency response",
    "A set of plants",
    "A structure of an uncertainty",
    "A controller",
    "A closed loop",
    "A peak over frequency",
    "Margins of a loop",
)


@pytest.fixture(scope="module")
def tool():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS / "_tools")
        import type_tables

        yield type_tables
    sys.modules.pop("type_tables")


def found(name):
    """What a dotted name inside the library means: an attribute, or a field of a dataclass."""
    *path, last = f"workbench.{name}".split(".")
    try:
        owner = importlib.import_module(".".join(path))
    except ModuleNotFoundError:
        owner = found(".".join(path[1:]))
    return getattr(owner, "__dataclass_fields__", {}).get(last) or getattr(owner, last)


def test_the_page_is_that_of_the_table(tool):
    written = tool.PAGE.read_text(encoding="utf-8")
    assert written == tool.text(), "write it anew: python docs/_tools/type_tables.py"


def test_every_type_with_a_meaning_has_a_row(tool):
    rows = set().union(*map(tool.named, tool.meanings()))
    without = {
        name: meaning["name"]
        for meaning in tool.meanings()
        for name, one in tool.types().items()
        if tool.belongs(name, one, meaning) and name not in rows
    }
    assert without == {}, "merge it, or give it a row in docs/_tools/types.toml"


def test_every_public_type_has_a_row(tool):
    pages, rows = reference(), set(re.findall(r"^\| `(\w+)`", tool.text(), re.MULTILINE))
    offered = {
        name: getattr(room, name)
        for room in map(importlib.import_module, pages.ROOMS)
        for name in pages.public_names(room)
    }
    classes = {name for name, thing in offered.items() if inspect.isclass(thing)}
    ours = {name for name in classes if offered[name].__module__.startswith("workbench.")}
    assert ours - rows == PUBLIC_OF_A_MEANING


def test_every_row_is_a_type_of_one_meaning_only(tool):
    names = [name for meaning in tool.meanings() for name in tool.named(meaning)]
    assert sorted(set(names)) == sorted(names)
    assert set(names) <= set(tool.types())


def test_every_type_says_in_its_first_lines_why_it_differs(tool):
    silent = {
        name
        for meaning in tool.meanings()
        for name in meaning["types"]
        if "Unlike" not in "\n".join(tool.types()[name].doc.splitlines()[:10])
    }
    assert silent == set()


def test_the_page_has_these_meanings(tool):
    assert tuple(meaning["name"] for meaning in tool.meanings()) == MEANINGS


@pytest.mark.parametrize("name", MEANINGS)
def test_every_function_that_takes_gives_or_converts_exists(tool, name):
    meaning = next(each for each in tool.meanings() if each["name"] == name)
    assert all(meaning["types"].values()), "a type without a function"
    converters = [name for names in meaning["types"].values() for name in names]
    for function in (*meaning["take"], *meaning["give"], *converters):
        assert found(function) is not None, function


def test_a_class_is_known_by_its_last_word_and_by_its_fields(tool):
    meaning = {"words": ["Loop"], "fields": [["A", "B"], ["K: StateSpace"]]}

    def one(**fields):
        return tool.Type("here", (), fields, "")

    assert tool.belongs("OpenLoop", one(), meaning)
    assert not tool.belongs("Looping", one(), meaning)
    assert tool.belongs("Any", one(A="Array", B="Array", C="Array"), meaning)
    assert not tool.belongs("Any", one(A="Array"), meaning)
    assert tool.belongs("Any", one(K="StateSpace | None"), meaning)
    assert not tool.belongs("Any", one(K="RealArray"), meaning)
