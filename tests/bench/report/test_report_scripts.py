"""The scripts of the pages, run by a script engine without a page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from html_page import Make, Page, run_pages
from hypothesis import given
from hypothesis import strategies as st
from py_mini_racer import MiniRacer

from workbench.bench.report import pages, report

STATE = {"q": "", "outcome": "", "theme": "", "sort": ""}


@pytest.fixture(scope="module")
def engine() -> MiniRacer:
    found = MiniRacer()
    found.eval(str(pages.asset("listing.js")))
    return found


def call(engine: MiniRacer, name: str, *values: Any) -> Any:
    words = ", ".join(map(json.dumps, values))
    return json.loads(str(engine.eval(f"JSON.stringify({name}({words}))")))


def run(**known: Any) -> dict[str, Any]:
    given = {"problem": "lab/circle", "theme": "lab", "state": "holds", "outcome": "solved"}
    return given | {"parameters": {}, "words": "lab/circle exact speed=2.5"} | known


# --- the address ------------------------------------------------------------------------------


@given(st.fixed_dictionaries({name: st.text(max_size=8) for name in STATE}))
def test_the_address_keeps_the_state(engine: MiniRacer, state: dict[str, str]) -> None:
    address = call(engine, "writeState", state)
    assert re.fullmatch(r"[\w=&%.!~*'()-]*", address)
    assert call(engine, "readState", f"#{address}") == state


@pytest.mark.parametrize(
    ("address", "known"),
    [
        ("", {}),
        ("#", {}),
        ("#main", {}),
        ("#q=a%20b&sort=-seconds", {"q": "a b", "sort": "-seconds"}),
        ("#__proto__=x&constructor=y&=z&q", {}),
        ("#q=%E0%A4%A", {"q": "%E0%A4%A"}),
        ("#q=a=b", {"q": "a=b"}),
    ],
)
def test_any_address_is_read(engine: MiniRacer, address: str, known: dict[str, str]) -> None:
    assert call(engine, "readState", address) == STATE | known


# --- filter -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "fits"),
    [
        ({}, True),
        ({"q": "CIRCLE speed=2"}, True),
        ({"q": "circle speed=3"}, False),
        ({"q": "  "}, True),
        ({"theme": "lab"}, True),
        ({"theme": "other"}, False),
        ({"outcome": "holds"}, True),
        ({"outcome": "open"}, False),
        ({"outcome": "=solved"}, True),
        ({"outcome": "=failed"}, False),
        ({"theme": "lab", "q": "square"}, False),
    ],
)
def test_filter(engine: MiniRacer, state: dict[str, str], fits: bool) -> None:
    assert call(engine, "fits", run(), STATE | state) is fits


@pytest.mark.parametrize("state", ["fails", "partial", "uncertified", "stopped"])
def test_what_does_not_hold_is_found(engine: MiniRacer, state: str) -> None:
    assert call(engine, "fits", run(state=state), STATE | {"outcome": "open"})
    assert not call(engine, "fits", run(state=state), STATE | {"outcome": "holds"})


# --- sort -------------------------------------------------------------------------------------


def ordered(engine: MiniRacer, values: list[str], numeric: bool, sign: int) -> list[str]:
    words = json.dumps([values, numeric, sign])
    return list(
        json.loads(
            str(
                engine.eval(
                    f"(([v, n, s]) => JSON.stringify(v.sort((a, b) => compareValues(a, b, n, s))))"
                    f"({words})"
                )
            )
        )
    )


def test_numbers_are_sorted_as_such_and_what_is_none_comes_last(engine: MiniRacer) -> None:
    values = ["10", "", "-2", "nan", "1e-9", "inf", "9", "-inf"]
    assert ordered(engine, values, True, 1)[:6] == ["-inf", "-2", "1e-9", "9", "10", "inf"]
    assert ordered(engine, values, True, -1)[:6] == ["inf", "10", "9", "1e-9", "-2", "-inf"]


def test_words_are_sorted_as_people_count(engine: MiniRacer) -> None:
    values = ["speed 10", "", "speed 9", "Speed 1"]
    assert ordered(engine, values, False, 1) == ["Speed 1", "speed 9", "speed 10", ""]
    assert ordered(engine, values, False, -1) == ["speed 10", "speed 9", "Speed 1", ""]


@given(st.lists(st.floats().map(str), max_size=8), st.sampled_from([1, -1]))
def test_the_order_is_one(engine: MiniRacer, values: list[str], sign: int) -> None:
    once = ordered(engine, values, True, sign)
    assert ordered(engine, once, True, sign) == once
    numbers = [float(one) for one in once if one != "nan"]
    assert numbers == sorted(numbers, reverse=sign < 0)


def test_a_third_click_goes_back_to_themes(engine: MiniRacer) -> None:
    sorts = [""]
    for _ in range(3):
        sorts.append(call(engine, "nextSort", sorts[-1], "gap"))
    assert sorts == ["", "gap", "-gap", ""]
    assert call(engine, "nextSort", "-gap", "seconds") == "seconds"


# --- columns of parameters --------------------------------------------------------------------


def test_parameters_that_differ_within_a_problem_are_columns(engine: MiniRacer) -> None:
    runs = [
        run(parameters={"speed": "1", "axis": "x"}),
        run(parameters={"speed": "2", "axis": "x"}),
        run(problem="lab/other", parameters={"axis": "y"}),
    ]
    assert call(engine, "parameterColumns", runs) == ["speed"]
    assert call(engine, "parameterColumns", runs[1:]) == []
    many = [run(parameters={f"p{n}": str(k) for n in range(5)}) for k in range(2)]
    assert call(engine, "parameterColumns", many) == []
    assert call(engine, "parameterColumns", many, 5) == ["p0", "p1", "p2", "p3", "p4"]


# --- scripts and pages ------------------------------------------------------------------------


@pytest.mark.cases(0)
def test_scripts_find_in_the_pages_what_they_ask_for(
    root: Path, make: Make, make_comparison: Make
) -> None:
    """Every id that a script asks for is there, and the engine can read every script."""
    make()
    make_comparison()
    entry = report(root)
    asked = set[str]()
    for place in [entry, *run_pages(entry)]:
        page = Page(place)
        (script,) = page.raw["script"]
        MiniRacer().eval(f"(function () {{ {script} }})")  # read, not run: there is no page
        ids = {attributes["id"] for _, attributes in page.elements if "id" in attributes}
        wanted = set(re.findall(r'getElementById\("(\w+)"\)', script))
        missing = wanted - ids
        assert not missing or (missing == {"every"} and not page.all("button", "toggle")), place
        asked |= wanted
    assert {"count", "nothing", "clear", "large", "told", "every"} <= asked
