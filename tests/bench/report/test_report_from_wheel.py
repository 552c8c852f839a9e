"""Reports by an installed wheel, which lies where other people's packages do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from html_page import Make, Page

REPORT = """
import sys
from workbench.bench.report import points
from workbench.cli import main

if "broken" in sys.argv:
    def scaled(gap):
        raise RuntimeError("no ink")
    points.scaled = scaled
main(["report", "results", "--jobs", "1"])
"""


def pages(elsewhere: Callable[..., str], root: Path, *words: str) -> str:
    """What the pages of the runs say."""
    assert "index.html" in elsewhere("-c", REPORT, *words)
    (page,) = (root / "report" / "runs").glob("*.html")
    return Page(page).text


@pytest.mark.cases(0)
def test_a_comparison_has_its_page_whatever_its_numbers_are(
    elsewhere: Callable[..., str],
    root: Path,
    make_comparison: Make,
    cells_of: Callable[..., xr.Dataset],
) -> None:
    data = cells_of(["exact", "scs"])
    for name in ("gap", "statement", "solve", "certified"):
        values = data[name].values.astype(float)
        values.flat[:3] = np.inf, -np.inf, np.nan
        data[name] = data[name].dims, values
    make_comparison(methods=["exact", "scs"], dataset=data)
    text = pages(elsewhere, root)
    assert "every cell" in text and "Figure not drawn: every cell" not in text


@pytest.mark.cases(0)
def test_a_figure_that_fails_names_the_line_of_the_library_that_met_it(
    elsewhere: Callable[..., str], root: Path, make_comparison: Make
) -> None:
    make_comparison(methods=["exact", "scs"])
    text = pages(elsewhere, root, "broken")
    assert "Figure not drawn: every cell: RuntimeError: no ink (" in text
    assert "in scaled)" in text or "in every_cell)" in text
