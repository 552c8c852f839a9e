"""The order in which `make quick` runs what an edit reaches: the nearest tests first."""

from __future__ import annotations

import json
from itertools import groupby
from pathlib import Path

import pytest
from quick.chosen import Chosen

WORKERS = 2
"""Of `make quick`: pytest-xdist gives each a half of the tests, in their order."""


def keep_chosen(items: list[pytest.Item], told: Path, root: Path) -> list[pytest.Item]:
    """Put the chosen items in the order of their distance, and take out and return the others.

    Those of a file stay together, as they share what fixtures make.
    """
    chosen = Chosen.of_json(json.loads(told.read_text(encoding="utf-8")))
    near: dict[pytest.Item, int] = {}
    for item in items:
        function = item.nodeid.removesuffix(item.name) + item.name.partition("[")[0]
        file, _, name = function.partition("::")
        distance = chosen.distance(file, name.partition("::")[0], item.name.partition("[")[2][:-1])
        if distance is not None:
            near[item] = distance
    files = [list(group) for _, group in groupby(near, lambda item: item.path)]
    files.sort(key=lambda group: min(near[item] for item in group))
    halves: list[list[pytest.Item]] = [[] for _ in range(WORKERS)]
    for group in files:
        min(halves, key=len).extend(group)
    left_out = [item for item in items if item not in near]
    items[:] = [item for half in halves for item in half]
    return left_out
