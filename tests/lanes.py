"""What `make test` tries in part, and `make test-all` as a whole.

`make test` takes `MOST` cases of each test with parameters: the first, which is the plainest, and
others, the same in each run. Another number in `TURN` takes other ones. `make quick` and pytest by
itself try all cases of what they run.
"""

import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import pytest
from hypothesis import settings

ENVIRONMENT = "WORKBENCH_TESTS_QUICK"
"""Set to 1 by conftest.py when the slow tests are left out; its workers inherit it."""
TURN = "WORKBENCH_TESTS_TURN"
"""Which cases are tried: a number, 0 unless it is set."""
MOST = 3
"""Cases of a test with parameters in a sample."""

T = TypeVar("T")


def thinned(values: Iterable[Any], every: int) -> list[Any]:
    """All values; all but one in `every`, from the first on, are marked slow."""
    return [
        pytest.param(value, marks=() if k % every == 0 else pytest.mark.slow)
        for k, value in enumerate(values)
    ]


def examples(quick: int, whole: int) -> settings:
    """How many examples a property test tries in the quick tests, and in `make test-all`."""
    return settings(max_examples=quick if os.environ.get(ENVIRONMENT) else whole)


def sample(cases: Sequence[T], turn: int, most: int = MOST) -> list[T]:
    """The first case and `most` - 1 others, in their order; in the next turn the next ones.

    Of one case alone, each has its turn.
    """
    if len(cases) <= most:
        return list(cases)
    if most < 2:
        return [cases[turn % len(cases)]] * most
    others, start = len(cases) - 1, turn * (most - 1)
    chosen = {0} | {(start + k) % others + 1 for k in range(most - 1)}
    return [case for k, case in enumerate(cases) if k in chosen]


def keep_sample(items: list[pytest.Item], turn: int) -> list[pytest.Item]:
    """Take out and return the cases that are not in the sample of their test."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        name = item.nodeid.removesuffix(item.name) + item.name.partition("[")[0]
        tests.setdefault(name, []).append(item)
    kept = {one for cases in tests.values() for one in sample(cases, turn, _most(cases[0]))}
    left_out = [item for item in items if item not in kept]
    items[:] = [item for item in items if item in kept]
    return left_out


def _most(item: pytest.Item) -> int:
    """How many cases of its test `make test` takes: what its mark `cases` says."""
    mark = item.get_closest_marker("cases")
    told = mark.args[0] if mark else MOST
    return sys.maxsize if told is None else told
