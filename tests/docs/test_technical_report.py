"""The technical report reads its numbers from stored results, and all that it names exist."""

import importlib
import re
import sys
from pathlib import Path

import pytest

REPORT = Path(__file__).parents[2] / "docs" / "report"
TEXT = (REPORT / "report.typ").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def report():
    sys.path.insert(0, str(REPORT))
    try:
        return importlib.import_module("report")
    finally:
        sys.path.remove(str(REPORT))


def test_every_number_that_is_named_is_stored(report):
    named = re.findall(
        r'#?\b(val|whole|pair)\(\s*(F \+ )?"([\w/-]+)",\s*"(\w+)"', TEXT.replace("\n", " ")
    )
    assert len(named) > 30
    metrics = report.values()["metrics"]
    for kind, focus, problem, name in named:
        found = metrics[f"cd/focus/{problem}" if focus else problem]
        assert name in found
        if kind == "pair":  # both ends of a certified interval
            lower = found[name.replace("peak_", "peak_lower_")]
            assert lower <= found[name] <= 1.01 * lower


def test_the_text_has_no_number_of_a_result():
    prose = re.sub(r"#\w+\([^)]*\)|image\([^)]*\)|\$[^$]*\$|^#.*$|//.*$", "", TEXT, flags=re.M)
    assert re.findall(r"(?<![\w@.])\d+\.\d+(?!\w)", prose) == []


def test_every_figure_is_drawn(report):
    shown = set(re.findall(r'image\("([\w-]+)\.svg"', TEXT))
    assert shown == {*report.FIGURES, "study", "benchmarks"}


def test_chosen_items_of_the_ledger_are_there(report):
    assert len(report.ledger()) == len(report.CLAIMS)


@pytest.mark.slow
def test_it_is_typeset(report, tmp_path):
    pytest.importorskip("typst")
    assert report.make(tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
