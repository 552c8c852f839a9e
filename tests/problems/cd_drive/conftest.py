"""What several problems need: covers, solved once, and stored designs of K'."""

from functools import cache
from pathlib import Path

import pytest
from workbench.plants.cd_drive.uncertainty.circle_cover import circle_cover
from workbench.plants.cd_drive.uncertainty.stadium_cover import stadium_cover

import workbench as wb

REFERENCE = Path(__file__).parents[3] / "results" / "reference" / "cd"
COVERS = {"circle": circle_cover, "stadium": stadium_cover}


@pytest.fixture(scope="session")
def covered():
    """Program and certified answer of a cover at 60 frequencies, by axis, shape, method, gain."""

    @cache
    def find(axis, shape, method, gain="own"):
        program = COVERS[shape](axis, frequencies=60, gain=gain)
        solution = wb.solve(program, method)
        assert solution.certificate is not None, solution.message
        assert solution.certificate.valid, solution.certificate.failures
        return program, solution.answer

    return find


@pytest.fixture(scope="session")
def slower():
    """Stored runs of cd/<axis>/lower-bandwidth by axis."""
    return {
        axis: wb.open_run(next((REFERENCE / axis / "lower-bandwidth").iterdir()))
        for axis in ("focus", "radial")
    }
