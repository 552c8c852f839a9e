"""The page about other tools is made from the runs, and says what it leaves out."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import workbench as wb

DOCS = Path(__file__).parents[2] / "docs"
UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}


@pytest.fixture(scope="module")
def benchmarks():
    sys.path.insert(0, str(DOCS))
    try:
        return importlib.import_module("benchmarks")
    finally:
        sys.path.remove(str(DOCS))


def seconds(text):
    number, unit = text.split()
    return float(number) * UNITS[unit]


def test_ratios_of_the_page_are_those_of_its_times():
    text = (DOCS / "benchmarks.md").read_text(encoding="utf-8")
    rows = [re.split(r"\s*\|\s*", line.strip("| ")) for line in text.splitlines() if "|" in line]
    timed = [row for row in rows if len(row) == 6 and re.fullmatch(r"[\d.,e+]+ (us|ms|s)", row[3])]
    assert len(timed) >= 15
    for _, _, _, theirs, ours, ratio in timed:
        assert float(ratio.replace(",", "")) == pytest.approx(
            seconds(theirs) / seconds(ours), rel=0.06
        )
    peers = {row[2] for row in timed}
    named = {"SLICOT AB13MD", "SLICOT AB13DD", "CVXPY, Clarabel", "shapely", "dkpy"}
    assert named <= peers
    assert "SIPPY" in text and (DOCS / "benchmarks.svg").read_bytes().lstrip().startswith(b"<?xml")


@pytest.mark.cases(0)
def test_rows_of_a_small_run(benchmarks, project):
    run = wb.run("bench/geometry", sets=20, points=5, large=1000)
    rows = benchmarks.rows({"geometry": run})
    assert [row.peer for row in rows] == ["CVXPY, Clarabel"] * 2 + ["shapely"] * 2
    assert all(row.theirs > 0 and row.ours > 0 for row in rows)
    circles = run.data["seconds"].sel(task=["conic circles", "exact circles"]).values
    assert rows[0].theirs / rows[0].ours == pytest.approx(circles[0] / circles[1])


def test_a_peer_that_is_missing_is_told_with_how_to_install_it(benchmarks, monkeypatch):
    monkeypatch.setattr(benchmarks.importlib.util, "find_spec", lambda name: None)
    some = xr.Dataset(
        {
            "seconds": (("case", "by"), np.array([[1.0, 2.0], [4.0, 2.0]])),
            "group": ("case", ["10 states", "10 states"]),
        },
        coords={"by": ["workbench", "hinfsyn"]},
    )
    hinf, dk = benchmarks.of_synthesis(some)
    assert (hinf.theirs, hinf.ours) == pytest.approx((2.0, 2.0))  # geometric means
    assert "pip install dkpy==" in " ".join(dk.cells())
    assert "pip install sippy_unipi==" in benchmarks.fits({})
