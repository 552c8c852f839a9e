"""The page of a run says all that its folder holds, in tables with captions and scopes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from urllib.parse import unquote

import pytest
from html_page import Make, Page, run_pages

from workbench.bench.report import report
from workbench.bench.store import seal


@pytest.fixture
def pages(
    root: Path, make: Make, make_comparison: Make, shown: Callable[..., None]
) -> dict[str, Page]:
    """The pages of a report of each kind of run, by their files."""
    table = "| a | b |\n| --- | --: |\n| x | 2 |\n"
    shown({"first-table": table, "parts": f"One\n\n{table}\nOther\n\n{table}"})
    make("lab/circle", "0000000a")
    make("lab/filter", "0000000b", needs={"cover": "0000000a"}, message="note", failed=True)
    make("lab/bare", "0000000c", parameters={}, data={}, metrics={})
    make_comparison()
    entry = report(root)
    return {page.stem: Page(page) for page in [entry, *run_pages(entry)]}


@pytest.mark.cases(0)
def test_every_table_has_a_caption_and_scopes(pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        assert page.captions and all(caption.strip() for caption in page.captions), name
        for head in page.all("th"):
            assert head.get("scope") in ("row", "col", "rowgroup"), (name, head)
    (circle,) = [page for name, page in pages.items() if name.startswith("lab-circle")]
    assert circle.captions == [
        "Certificate",
        "Metrics",
        "Parameters",
        "Options",
        "Provenance",
        "Time",
        "Versions",
        "Data files and their SHA-256",
        "first table",
        "parts: One",
        "parts: Other",
    ]


@pytest.mark.cases(0)
def test_the_basics_of_reading_without_eyes_or_mouse(pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        assert page.all("html") == [{"lang": "en"}]
        assert len(page.all("h1")) == len(page.all("main")) == 1
        assert page.all("a", "skip")[0]["href"] == "#main"
        assert page.all("main")[0]["id"] == "main"
        ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
        assert len(ids) == len(set(ids)), name
        assert all("alt" in image for image in page.all("img"))
        assert all(button.get("type") == "button" for button in page.all("button"))
        for _, attributes in page.elements:
            if attributes.get("href", "").startswith("#") and "data-theme" not in attributes:
                assert attributes["href"][1:] in ids, (name, attributes)
        for attributes in page.all("div"):
            if attributes.get("tabindex"):
                assert attributes["aria-label"] and attributes["role"]


def test_what_the_folder_holds_is_said(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a")
    page = Page(run_pages(report(root))[0])
    assert "problem 'lab/circle' is not registered here" in page.text
    for words in (
        "315.286",  # metrics
        "distance of a point beyond its circle",  # certificate
        "radius above its bound",
        "07f22203e4ca2a17",  # provenance
        "c" * 64,
        "2026-01-02 03:04:05 UTC",
        "outcome: solved.",  # log
        "lab/circle/0000000a",
    ):
        assert words in page.text


def test_a_failure_says_so(root: Path, make: Make) -> None:
    folder = make(failed=True, message="LinAlgError: singular in /home/me/lab/problems/x.py")
    for name in ("certificate.json", "metrics.json", "log.txt"):
        (folder / name).unlink()
    seal(folder)
    make(key="0000000b", failed=True, value="nan")
    wrong, none = (Page(page) for page in run_pages(report(root)))
    assert "kept as a failure" in none.text and "kept as a failure" in wrong.text
    assert "singular in …/problems/x.py" in none.text
    assert "there is no answer to check" in none.text
    assert "NaN" in wrong.text


def test_needs_lead_to_their_runs(root: Path, make: Make) -> None:
    make("lab/circle", "0000000a")
    make("lab/filter", "0000000b", needs={"cover": "0000000a", "drives": ["0000000a", "ffffffff"]})
    circle, other = run_pages(report(root))
    links = [link["href"] for link in Page(other).all("a")]
    assert links.count(circle.name) == 2
    assert "ffffffff" in Page(other).text


def test_links_are_relative_and_lead_there(root: Path, make: Make, tmp_path: Path) -> None:
    folder = make()
    for output in (None, tmp_path / "pages" / "a b"):
        entry = report(root, output=output)
        (page,) = run_pages(entry)
        hrefs = [link["href"].partition("#")[0] for link in Page(page).all("a")]
        found = [(page.parent / unquote(href)).resolve() for href in hrefs if href]
        assert folder.resolve() in found and entry.resolve() in found
        assert all(place.exists() for place in found)
        for file in (page, entry):
            assert str(tmp_path) not in file.read_text(encoding="utf-8")


# --- comparisons ------------------------------------------------------------------------------


def comparison(root: Path) -> Page:
    (page,) = [p for p in run_pages(report(root)) if p.name.startswith("compare")]
    return Page(page)


@pytest.mark.cases(0)
def test_a_comparison_says_what_is_certified_and_what_is_false(
    root: Path, make: Make, make_comparison: Make, shown: Callable[..., None]
) -> None:
    shown()
    make()
    make_comparison()
    page = comparison(root)
    assert "98.9 % of 87 cells certified, 1 false claim." in page.text
    assert "comparison of lab/*" in page.text
    assert "3 problems, 10 methods, 3 accuracy levels" in page.text
    said = page.text[: page.text.index("Methods")].lower()
    assert "solved" not in said and "holds" not in said
    index = Page(root / "index.html")
    (row,) = [row for row in index.rows if row["data-run"].startswith("compare")]
    assert (row["data-state"], row["data-outcome"]) == ("fails", "")
    assert "98.9 % of 87 cells certified, 1 false claim" in index.text
    assert "runs1hold1donothold0comparisons1" in "".join(index.text.split())


@pytest.mark.cases(0)
def test_methods_of_a_comparison_can_be_toggled(
    root: Path, make_comparison: Make, shown: Callable[..., None]
) -> None:
    table = "| problem | method | s |\n| --- | --- | --: |\n| x | method-a | 2 |\n"
    shown({"cells": table})
    make_comparison()
    page = comparison(root)
    methods = [f"method-{letter}" for letter in "abcdefghij"]
    assert [one["data-toggle"] for one in page.all("button") if "data-toggle" in one] == methods
    assert {g["data-method"] for g in page.all("g") if "data-method" in g} == set(methods)
    assert [row.get("data-method") for row in page.all("tr") if "data-method" in row] == [
        "method-a"
    ]
    assert "lab/0 by method-b, high: wrong, no certified gap, 0.044 s" in page.text
    points = [use for use in page.all("use") if "x" in use]
    assert len(points) >= 87  # a cell each, and the marks of the axes
    templates = page.all("template")
    assert len(templates) == 1  # inert until it is looked at
    assert page.all("img")[0]["alt"] == "every cell: figure of comparison of lab/*"


def test_cells_that_cannot_be_read_leave_a_sentence(
    root: Path, make_comparison: Make, shown: Callable[..., None]
) -> None:
    shown()
    make_comparison(dataset=None)
    assert "Figure not drawn: every cell: " in comparison(root).text


def test_a_method_that_is_hostile_is_text(
    root: Path, make_comparison: Make, shown: Callable[..., None]
) -> None:
    shown()
    name = '"><script>alert(1)</script>'
    make_comparison(methods=[name, "b", "c"])
    page = comparison(root)
    assert len(page.all("script")) == 1
    assert [b["data-toggle"] for b in page.all("button") if "data-toggle" in b] == [name, "b", "c"]
