"""The page on methods says what the stored comparison says."""

import sys
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.bench.comparison.numbers import groups
from workbench.bench.describe import describe
from workbench.bench.project import registry

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def study():
    sys.path.insert(0, str(DOCS))
    try:
        import study
    finally:
        sys.path.remove(str(DOCS))
    return study


@pytest.fixture(scope="module")
def data(study):
    return study.stored().data


def test_the_page_is_that_of_the_stored_comparison(study):
    assert study.page(study.stored()) == (DOCS / "study.md").read_text(encoding="utf-8")
    assert (DOCS / "study.svg").read_bytes().lstrip().startswith(b"<?xml")


@pytest.mark.cases(0)
def test_every_fast_problem_with_methods_is_in_it_at_every_level(data):
    entries = (entry for entry in wb.problems("*") if not entry.slow)
    fast = {entry.name for entry in entries if describe(registry().find(entry.name)).methods}
    assert set(data["problem"].values) == fast
    assert data["accuracy"].values.tolist() == ["low", "middle", "high"]


def test_conclusions_follow_from_the_cells(study, data):
    """Counted again, without the functions that the page is made with."""
    for program, part in groups(data):
        verdicts = part["verdict"].values
        found = {one.method: one for one in study.judged(part)}
        for j, name in enumerate(part["by_method"].values.tolist()):
            tried = ~np.isin(part["outcome"].values[:, j], ["unfit", ""])
            if not tried.any():
                assert name not in found
                continue
            good = np.isin(verdicts[:, j], ["solved", "infeasible", "unbounded"])
            one = found[name]
            assert (one.cells, one.certified) == (tried.sum(), good.sum()), (program, name)
            assert one.wrong == (verdicts[:, j] == "wrong").sum()
            said = study.verdict(list(found.values()))
            trusted = said.partition("The least")[0]
            assert (f"`{name}`" in trusted) == one.always or "No method" in said


def test_no_certified_answer_is_better_than_the_best(study, data):
    for _, part in groups(data):
        above = study.excesses(part)
        assert np.nanmin(np.where(np.isfinite(above), above, np.inf)) >= 0.0
        assert all(one.excess >= 0 for one in study.judged(part))
