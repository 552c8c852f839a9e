"""Parameters that the quick tests try in part and `make test-all` as a whole."""

import os
from collections.abc import Iterable
from typing import Any

import pytest
from hypothesis import settings

ENVIRONMENT = "WORKBENCH_TESTS_QUICK"
"""Set to 1 by conftest.py when the slow tests are left out; its workers inherit it."""


def thinned(values: Iterable[Any], every: int) -> list[Any]:
    """All values; all but one in `every`, from the first on, are marked slow."""
    return [
        pytest.param(value, marks=() if k % every == 0 else pytest.mark.slow)
        for k, value in enumerate(values)
    ]


def examples(quick: int, whole: int) -> settings:
    """How many examples a property test tries in the quick tests, and in `make test-all`."""
    return settings(max_examples=quick if os.environ.get(ENVIRONMENT) else whole)
