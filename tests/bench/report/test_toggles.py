"""Figures with parts of methods, as a page holds them."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray as xr
from html_page import Page

from workbench import figures
from workbench._core.heavy_types import Figure
from workbench.bench.comparison.styles import GID
from workbench.bench.report.points import every_cell, scaled
from workbench.bench.report.toggles import has_methods, telling, toggled
from workbench.errors import ResultError
from workbench.figures.formats import svg

HOSTILE = """<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"
 width="10" onload="alert(1)" viewBox="0 0 1 1"><script>alert(2)</script><style>*{color:red}</style>
 <foreignObject><p>x</p></foreignObject><a href="javascript:alert(3)"><path d="M0 0"/></a>
 <g id="method:a" onclick="alert(4)" style="fill: url(http://x.y/z)"><title>&lt;script&gt;</title>
 <use xlink:href="http://x.y/#z"/><image xlink:href="file:///etc/passwd"/>
 <use xlink:href="#mark" x="1"/></g><path id="mark" clip-path="url(#clip)"/></svg>"""


def drawn() -> Figure:
    figure, (panel,) = figures.axes(1, 1)
    panel.plot([0, 1], [0, 1], "o-", gid=f"{GID}a b")
    panel.plot([0, 1], [1, 0], "o-", gid=f"{GID}c")
    return figure


def test_parts_of_methods_are_marked() -> None:
    figure = drawn()
    assert has_methods(figure) and not has_methods(figures.axes(1, 1)[0])
    found = toggled(svg(figure), "f0-")
    assert found.methods == ("a b", "c")
    page = Page(found.markup)
    assert [g["data-method"] for g in page.all("g") if "data-method" in g] == ["a b", "c"]
    ids = {attributes["id"] for _, attributes in page.elements if "id" in attributes}
    assert ids and all(name.startswith("f0-") for name in ids)
    wanted = {use["href"][1:] for use in page.all("use")}
    wanted |= set(re.findall(r"url\(#([^)]+)\)", found.markup))
    assert wanted and wanted <= ids
    assert "width" not in page.all("svg")[0] and "viewbox" in page.all("svg")[0]


def test_the_same_figure_gives_the_same_bytes() -> None:
    assert svg(drawn()) == svg(drawn())


def test_only_drawing_comes_into_a_page() -> None:
    found = toggled(HOSTILE.encode(), "f1-")
    assert found.methods == ("a",)
    page = Page(found.markup)
    assert {tag for tag, _ in page.elements} == {"svg", "g", "title", "use", "image", "path"}
    for _, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on")]
    assert not re.search(r"http:|file:|javascript|color", found.markup)
    assert [use.get("href") for use in page.all("use")] == [None, "#f1-mark"]
    assert "<title>&lt;script&gt;</title>" in found.markup
    assert 'clip-path="url(#f1-clip)"' in found.markup


@pytest.mark.parametrize("source", [b"", b"<svg/>", b"<p>", b"\x89PNG", b"<html></html>"])
def test_what_is_no_svg_is_refused(source: bytes) -> None:
    with pytest.raises(ValueError, match="no SVG"):
        toggled(source, "f0-")


def test_points_say_what_they_are_in_the_order_of_the_drawing() -> None:
    figure = drawn()
    source = telling(
        svg(figure), [(f"{GID}a b", ["first", "second"]), (f"{GID}c", ["third", "fourth"])]
    )
    titles = {}
    for part in ElementTree.fromstring(source).iter("{http://www.w3.org/2000/svg}g"):
        if str(part.get("id")).startswith(GID):
            uses = part.iter("{http://www.w3.org/2000/svg}use")
            titles[part.get("id")] = [(float(use.get("x", "nan")), use[0].text) for use in uses]
    for words in (["first", "second"], ["third", "fourth"]):
        (found,) = [one for one in titles.values() if one[0][1] == words[0]]
        assert [told for _, told in sorted(found)] == words  # from left to right


def test_a_missing_sentence_is_an_error() -> None:
    with pytest.raises(ValueError, match="zip"):
        telling(svg(drawn()), [(f"{GID}a b", ["only one"])])


# --- cells ------------------------------------------------------------------------------------


def test_every_cell_is_a_point(cells_of) -> None:
    data = cells_of(["a", "b", "c"])
    figure, told = every_cell(data)
    sentences = [one for _, words in told for one in words]
    assert len(sentences) == len(set(sentences)) == 27 - 3  # three cells are unfit
    assert "lab/0 by a, low: solved, gap 0.01, 0.011 s" in sentences
    assert {gid for gid, _ in told} == {"method:a", "method:b", "method:c"}
    source = telling(svg(figure), told)  # fails where points and sentences do not match
    assert all(one.encode() in source for one in sentences)


def test_repetitions_are_told_apart(cells_of) -> None:
    one = cells_of(["a"], problems=1)
    data = xr.concat([one, one.assign_coords(repetition=[1])], "repetition")
    sentences = [words for _, part in every_cell(data)[1] for words in part]
    assert "lab/0 by a, low, repetition 1: solved, gap 0.01, 0.011 s" in sentences


def test_an_older_comparison_has_points_too(cells_of) -> None:
    data = cells_of(["a", "b"]).isel(repetition=0, drop=True)
    data = data.drop_vars("verdict").rename(certified="success")
    assert sum(len(words) for _, words in every_cell(data)[1]) == 18


@pytest.mark.cases(0)
def test_too_many_cells_or_none_are_said(cells_of) -> None:
    with pytest.raises(ResultError, match="are too many points"):
        every_cell(cells_of([f"m{number}" for number in range(40)], problems=50))
    data = cells_of(["a"])
    with pytest.raises(ResultError, match="no cell has a time"):
        every_cell(data.assign(solve=data["solve"] * float("nan")))


def test_gaps_of_both_signs_have_their_height() -> None:
    heights = scaled(np.array([-1.0, -1e-13, 0.0, 1e-13, 1e-6, 1.0]))
    assert (np.diff(heights) > 0).all()
    np.testing.assert_allclose(heights[[0, 2, 4, 5]], [-12.0, 0.0, 6.0, 12.0], atol=1e-5)
    assert np.isnan(scaled(np.array([np.nan]))).all()
