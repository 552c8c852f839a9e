"""Covers of the twelve drives, each solved once."""

from functools import cache

import pytest

import workbench as wb
from problems.cd_drive.covers import circle_cover, stadium_cover

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
