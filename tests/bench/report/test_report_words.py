"""Numbers, paths, tables and badges as the report says them."""

from __future__ import annotations

import math
from typing import Any

import pytest
from html_page import Page
from hypothesis import given
from hypothesis import strategies as st

from workbench.bench.report.badges import _of_cells
from workbench.bench.report.markdown_tables import tables_as_html
from workbench.bench.report.words import number, pathless


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (315.28555396, ">315.286<"),
        (-1.5e-9, ">−1.5×10<sup>−9</sup><"),
        (2e20, ">2×10<sup>20</sup><"),
        ("nan", ">NaN<"),
        ("-inf", ">−∞<"),
    ],
)
def test_numbers_are_set(value: Any, shown: str) -> None:
    assert shown in number(value)


@pytest.mark.parametrize(
    ("words", "shown"),
    [
        ('File "/home/me/my lab/workbench/program.py"', 'File "…/workbench/program.py"'),
        ("/opt/lib/python3.11/site-packages/scipy/a.py", "…/scipy/a.py"),
        ("C:\\Users\\me\\x.csv and file:///home/me/x.csv", "…/x.csv and file://…/x.csv"),
        ("lab/circle, 3 / 4 m/s, https://a.b/c/d, ../x/y", None),
    ],
)
def test_machine_paths_are_cut(words: str, shown: str | None) -> None:
    assert pathless(words) == (shown or words)


# --- tables -----------------------------------------------------------------------------------


def test_tables_are_shown_as_tables() -> None:
    html = tables_as_html("| a | b |\n| --- | ---: |\n| <i> | 2 |\n\nUnfit: x & y\n", "cells")
    assert "<caption>cells</caption>" in html
    assert '<th scope="row">&lt;i&gt;</th>' in html
    assert '<td class="num">2</td>' in html
    assert '<th scope="col" class="num">b</th>' in html
    assert "<p>Unfit: x &amp; y</p>" in html


def test_a_column_of_numbers_heads_no_rows() -> None:
    html = tables_as_html("| a | b |\n| --: | --- |\n| 1 | x |\n", "cells")
    assert '<td class="num">1</td>' in html and 'scope="row"' not in html


def test_a_short_line_above_a_table_is_in_its_caption() -> None:
    table = "| a |\n| - |\n| `x <y>` |\n"
    html = tables_as_html(f"{'Long words. ' * 9}\n\nStadium\n\n{table}", "means")
    assert "<caption>means: Stadium</caption>" in html
    assert f"<p>{'Long words. ' * 9}</p>" in html
    assert "<code>x &lt;y&gt;</code>" in html


def test_code_keeps_its_lines() -> None:
    html = tables_as_html(
        "| a |\n| - |\n| 1 |\n\n```c\nif (a < b)\n\n    | x |\n```\nafter\n", "code"
    )
    assert "<code>if (a &lt; b)\n\n    | x |\n</code></pre>" in html
    assert html.count("<table>") == 1 and "<p>after</p>" in html


def test_rows_of_methods_can_be_toggled() -> None:
    html = tables_as_html("| problem | method |\n| - | - |\n| x | a&b |\n", "cells")
    assert '<tr data-method="a&amp;b">' in html


def test_a_bar_within_a_cell_costs_the_lines_of_its_table_only() -> None:
    html = tables_as_html("| a | b |\n| - | - |\n| x | y|z |\n\n| a |\n| - |\n| 1 |\n", "cells")
    assert "<pre>a | b\n- | -\nx | y | z</pre>" in html
    assert html.count("<table>") == 1


@given(st.text(alphabet="|-: \nab<`", max_size=60))
def test_any_text_is_shown(markdown: str) -> None:
    page = Page(tables_as_html(markdown, "name"))
    assert all(caption for caption in page.captions)
    allowed = ["table", "caption", "thead", "tbody", "tr", "th", "td", "p", "pre", "code"]
    assert {tag for tag, _ in page.elements} <= {*allowed}


# --- badges -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("metrics", "state", "words"),
    [
        (
            {"certified_share": 1 / 45, "cells": 45, "false_claims": 0},
            "partial",
            "2.2 % of 45 cells certified, 0 false claims",
        ),
        (
            {"certified_share": 1.0, "cells": 1, "false_claims": 0},
            "holds",
            "100 % of 1 cell certified, 0 false claims",
        ),
        (
            {"certified_share": 1.0, "cells": 9, "false_claims": 2},
            "fails",
            "100 % of 9 cells certified, 2 false claims",
        ),
        (
            {"certified_share": 1.0, "cells": 9, "false_claims": 0, "contradictions": 1},
            "fails",
            "100 % of 9 cells certified, 0 false claims, 1 contradiction",
        ),
        (
            {"success_rate": 0.99999, "cells": 1e5},
            "partial",
            "99.9 % of 100000 cells certified, false claims not counted",
        ),
        (
            {"certified_share": 1e-6, "cells": 1e6, "false_claims": 1},
            "fails",
            "0.1 % of 1000000 cells certified, 1 false claim",
        ),
        (
            {"certified_share": math.nan, "cells": 0, "false_claims": 0},
            "partial",
            "unknown share of 0 cells certified, 0 false claims",
        ),
        (
            {},
            "partial",
            "unknown share of unknown number of cells certified, false claims not counted",
        ),
    ],
)
def test_a_comparison_is_never_said_to_hold_more_than_it_does(
    metrics: dict[str, float], state: str, words: str
) -> None:
    found = _of_cells(metrics)
    assert (found.state, found.words, found.outcome) == (state, words, "")
