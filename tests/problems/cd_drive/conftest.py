"""What several problems need: stored covers, and stored designs of K'."""

from functools import cache
from pathlib import Path

import pytest

import workbench as wb

REFERENCE = Path(__file__).parents[3] / "results" / "reference" / "cd"


@pytest.fixture(scope="session")
def covered():
    """Program and answer of a stored cover at 120 frequencies, by axis, shape, method, gain."""

    @cache
    def find(axis, shape, method, gain="own"):
        runs = map(wb.open_run, (REFERENCE / axis / f"{shape}-cover").iterdir())
        (run,) = (r for r in runs if (r.method, r.info["parameters"]["gain"]) == (method, gain))
        return run.task, run.answer

    return find


@pytest.fixture(scope="session")
def slower():
    """Stored runs of cd/<axis>/lower-bandwidth by axis."""
    return {
        axis: wb.open_run(next((REFERENCE / axis / "lower-bandwidth").iterdir()))
        for axis in ("focus", "radial")
    }
