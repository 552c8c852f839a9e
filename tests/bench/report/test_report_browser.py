"""The pages in a headless Chromium, where there is one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browser import Browser, browser, executable
from html_page import Make, run_pages

from workbench import figures
from workbench.bench.report import report, single_page

pytestmark = pytest.mark.skipif(executable() is None, reason="no Chromium on this machine")
METHODS = [f"method-{letter}" for letter in "abcdefghij"]


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("browser")) as one:
        yield one


@pytest.fixture
def page(chromium: Browser) -> Iterator[Browser]:
    """The browser with no memory of other tests; whatever it complains of fails the test."""
    chromium.requests.clear()
    chromium.complaints.clear()
    chromium.size(1280, 900)
    yield chromium
    assert chromium.complaints == []


@pytest.fixture
def entry(root: Path, make: Make, make_comparison: Make, shown: Callable[..., None]) -> Path:
    figure, (panel,) = figures.axes(1, 1, size=(3.0, 2.0))
    panel.plot([0.0, 1.0])
    table = "| problem | method |\n| - | - |\n" + "".join(f"| x | {one} |\n" for one in METHODS)
    shown({"cells": table}, bode=figure)
    make("lab/circle", "0000000a", parameters={"speed": 10.0})
    make("lab/circle", "0000000b", parameters={"speed": 9.0})
    make("lab/stadium", "0000000c", failed=True)
    make("shop/disc", "0000000d")
    make_comparison()
    return report(root)


def shown_runs(page: Browser) -> list[str]:
    """The runs that the table shows, in its order."""
    script = """[...document.querySelectorAll("tr.run")].filter((row) => row.offsetParent !== null)
        .map((row) => row.dataset.run)"""
    return list(page.run(script))


def typed(page: Browser, words: str) -> None:
    page.run("document.getElementById('words').focus()")
    page.call("Input.insertText", text=words)


@pytest.mark.cases(0)
def test_search_and_filter_are_in_the_address(page: Browser, entry: Path) -> None:
    page.open(entry)
    assert len(shown_runs(page)) == 5
    typed(page, "lab circle")
    assert shown_runs(page) == ["lab/circle/0000000a", "lab/circle/0000000b"]
    assert page.run("location.hash") == "#q=lab%20circle"
    assert page.run("document.getElementById('count').textContent") == "2 of 5"
    page.open(entry, "outcome=open&q=lab")
    assert shown_runs(page) == ["compare/0000c0de", "lab/stadium/0000000c.failed"]
    assert page.run("document.getElementById('words').value") == "lab"
    page.run("document.getElementById('clear').click()")
    assert len(shown_runs(page)) == 5
    page.run("document.querySelector(\".themes [data-theme='shop']\").click()")
    page.wait("location.hash === '#theme=shop'")
    page.wait("document.getElementById('count').textContent === '1 of 5'")
    assert shown_runs(page) == ["shop/disc/0000000d"]
    assert page.run("document.querySelector('.themes [aria-current]').dataset.theme") == "shop"
    page.open(entry, "outcome=nonsense&theme=lab")
    assert len(shown_runs(page)) == 3


@pytest.mark.cases(0)
def test_sort_and_columns_of_parameters(page: Browser, entry: Path) -> None:
    page.open(entry, "theme=lab")
    heads = "[...document.querySelector('.runs thead tr').cells].map((one) => one.textContent)"
    assert "speed" in page.run(heads)
    click = "document.querySelector(\"[data-column='p:speed'] button\").click()"
    page.run(click)
    assert shown_runs(page)[:2] == ["lab/circle/0000000b", "lab/circle/0000000a"]
    assert page.run("location.hash") == "#theme=lab&sort=p%3Aspeed"
    page.run(click)
    assert shown_runs(page)[:2] == ["lab/circle/0000000a", "lab/circle/0000000b"]
    assert page.run("document.querySelector('[aria-sort=descending]').textContent") == "speed"
    page.run(click)
    assert page.run("document.querySelectorAll('[aria-sort=descending]').length") == 0
    page.open(entry, "theme=shop")
    assert "speed" not in page.run(heads)


@pytest.mark.cases(0)
@pytest.mark.parametrize("dark", [False, True])
def test_every_page_fits_a_phone(page: Browser, entry: Path, dark: bool) -> None:
    page.size(390, 844, dark)
    for place in [entry, *run_pages(entry)]:
        page.open(place)
        assert page.run("document.documentElement.scrollWidth") == 390, place
        paper = page.run("getComputedStyle(document.body).backgroundColor")
        assert (paper == "rgb(20, 24, 28)") is dark


@pytest.mark.cases(0)
def test_nothing_leaves_the_folder(page: Browser, entry: Path) -> None:
    for place in [entry, *run_pages(entry)]:
        page.open(place)
        page.run("scrollTo(0, document.body.scrollHeight)")
    inside = entry.parent.absolute().as_uri()
    asked = [way for way in page.requests if way != "about:blank"]
    assert any(way.endswith(".png") for way in asked)
    assert all(way.startswith((inside, "data:")) for way in asked)


def comparison(entry: Path) -> Path:
    (found,) = [place for place in run_pages(entry) if place.name.startswith("compare")]
    return found


DRAWN = "document.querySelector('.drawing')"
VISIBLE = f"""[...new Set([...{DRAWN}.querySelectorAll("[data-method]")]
    .filter((part) => getComputedStyle(part).display !== "none")
    .map((part) => part.dataset.method))].sort()"""


@pytest.mark.cases(0)
def test_ten_methods_can_be_toggled(page: Browser, entry: Path) -> None:
    page.open(comparison(entry))
    page.run("document.querySelector('figure.toggled').scrollIntoView()")
    page.wait(f"{DRAWN} !== null")
    assert page.run(VISIBLE) == METHODS
    toggle = "document.querySelector(\"[data-toggle='method-c']\")"
    page.run(f"{toggle}.click()")
    assert page.run(VISIBLE) == [name for name in METHODS if name != "method-c"]
    assert page.run(f"{toggle}.getAttribute('aria-pressed')") == "false"
    assert page.run("location.hash") == "#hide=method-c"
    rows = "[...document.querySelectorAll('.sheetwise tr[data-method]')]"
    assert page.run(f"{rows}.filter((row) => row.offsetParent !== null).length") == 9
    page.open(comparison(entry), "hide=method-a,method-b,unknown")
    page.wait(f"{DRAWN} !== null")
    assert page.run(VISIBLE) == METHODS[2:]
    page.run("document.getElementById('every').click()")
    assert page.run(VISIBLE) == METHODS


@pytest.mark.cases(0)
def test_points_tell_what_they_are(page: Browser, entry: Path) -> None:
    page.open(comparison(entry))
    page.wait(f"{DRAWN} !== null")
    page.run(f"{DRAWN}.scrollIntoView({{ block: 'center' }})")
    page.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    mark = f"{DRAWN}.querySelector(\"[data-method='method-b'] use[x]\")"
    box = page.run(f"(({{ x, y, width, height }}) => [x + width / 2, y + height / 2])"
                   f"({mark}.getBoundingClientRect())")  # fmt: skip
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=box[0], y=box[1])
    page.wait("!document.getElementById('told').hidden")
    said = page.run("document.getElementById('told').textContent")
    assert said.startswith("lab/0 by method-b, low: solved, gap 0.0079, ")
    page.run(f"{DRAWN}.focus()")
    page.key("ArrowRight")
    other = page.run("document.getElementById('told').textContent")
    assert other.startswith("lab/") and other != said
    page.key("ArrowRight")
    assert page.run("document.getElementById('told').textContent") not in (said, other)
    page.key("Escape")
    assert page.run("document.getElementById('told').hidden") is True


@pytest.mark.cases(0)
def test_figures_are_enlarged(page: Browser, entry: Path) -> None:
    (place,) = [one for one in run_pages(entry) if one.name.startswith("shop")]
    page.open(place)
    page.run("document.querySelector('button.enlarge').click()")
    assert page.run("document.getElementById('large').open") is True
    page.wait("document.querySelector('.sheet img').naturalWidth === 360")
    page.run("document.querySelector('#large button').click()")
    assert page.run("document.getElementById('large').open") is False


def test_a_single_page_needs_nothing_else(
    page: Browser, make_comparison: Make, shown: Callable[..., None], tmp_path: Path
) -> None:
    shown()
    place = single_page(make_comparison(), tmp_path / "alone.html")
    page.open(place)
    page.wait(f"{DRAWN} !== null")
    assert page.run(VISIBLE) == METHODS
    assert {way for way in page.requests if not way.startswith("data:")} <= {
        "about:blank",
        place.as_uri(),
    }
