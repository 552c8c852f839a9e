"""The tests that an edit reaches, nearest first, and those of them that go through a family."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from quick.sources import VARIES

FAR = 1000
"""Distance of a test that goes through a family: it comes last."""


@dataclass(frozen=True)
class Chosen:
    """Tests by file and function, with their distances from the edit.

    A test that goes through all problems, pages or names of the library runs for those alone that
    the edit reaches, where its name tells which one it is about: ``reached`` of all ``labels``.
    """

    tests: Mapping[str, Mapping[str, int]]
    labels: tuple[str, ...]
    reached: tuple[str, ...]

    @classmethod
    def of_json(cls, told: Mapping[str, Any]) -> Chosen:
        return cls(told["tests"], tuple(told["labels"]), tuple(told["reached"]))

    def to_json(self) -> dict[str, Any]:
        return {"tests": self.tests, "labels": self.labels, "reached": self.reached}

    def distance(self, file: str, name: str, case: str = "") -> int | None:
        """How far a test is from the edit; None where the edit cannot reach it."""
        near = self.tests.get(file, {}).get(name)
        if near == FAR and _about(case, self.labels) and not _about(case, self.reached):
            return None
        return near


def _about(case: str, labels: tuple[str, ...]) -> bool:
    """Whether a case of a test is called after one of the labels."""
    return bool(case) and _any(labels).search(case) is not None


@cache
def _any(labels: tuple[str, ...]) -> re.Pattern[str]:
    """One of some labels as a whole: no letter, digit or dot goes on before or behind it."""
    words = "|".join(re.escape(one).replace(VARIES, "[^/]+") for one in labels) or "(?!)"
    return re.compile(rf"(?<![\w./])(?:{words})(?![\w.]|-\w)")
