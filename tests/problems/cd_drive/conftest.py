"""What several problems need: stored covers, and stored designs of K'."""

from functools import cache

import pytest


@pytest.fixture(scope="session")
def covered(reference):
    """Program and answer of a stored cover, by axis, shape, method, gain."""

    @cache
    def find(axis, shape, method, gain="own"):
        run = reference(f"cd/{axis}/{shape}-cover", method, gain=gain)
        return run.task, run.answer

    return find


@pytest.fixture(scope="session")
def slower(reference):
    """Stored runs of cd/<axis>/lower-bandwidth by axis."""
    return {axis: reference(f"cd/{axis}/lower-bandwidth") for axis in ("focus", "radial")}
