"""The names that broke the law when it was made; their list only shrinks.

    PYTHONPATH=tests python -m surface.exceptions

strikes out the names that obey by now.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from surface.reading import library
from surface.rules import Breach, breaches

LIST = Path(__file__).with_name("exceptions.toml")
# A list that may lose lines and gain none: every line has its digest in `frozen.txt`, which holds
# those of all lines that there were when the law was made. Nothing writes that file any more.
FROZEN = Path(__file__).with_name("frozen.txt")
HEAD = """\
# Public names that break the law of docs/reference/conventions.md: rule, place, lawful name.
# Lines are only struck out, by `PYTHONPATH=tests python -m surface.exceptions`; none is added.
"""
Tables = Mapping[str, Mapping[str, str]]


def excepted() -> Tables:
    """What the list holds: for each rule, places with what would be lawful."""
    return tomllib.loads(LIST.read_text(encoding="utf-8"))


def frozen() -> set[str]:
    """The digests of all lines that the list ever had."""
    return set(FROZEN.read_text(encoding="utf-8").split())


def digest(rule: str, place: str) -> str:
    """What stands for a line of the list."""
    return hashlib.sha256(f"{rule} {place}".encode()).hexdigest()[:8]


def listed(found: Iterable[Breach]) -> Tables:
    """Breaches in the form of the list."""
    tables: dict[str, dict[str, str]] = {}
    for one in sorted(found, key=lambda breach: (breach.rule, breach.place)):
        tables.setdefault(one.rule, {})[one.place] = one.lawful
    return tables


def written(tables: Tables) -> str:
    """The text of the list."""
    parts = [HEAD]
    for rule, places in tables.items():
        lines = [f'"{place}" = "{lawful}"' for place, lawful in places.items()]
        parts.append("\n".join([f"[{rule}]", *lines]) + "\n")
    return "\n".join(parts)


def objections(found: Iterable[Breach], exceptions: Tables, known: Collection[str]) -> list[str]:
    """What is wrong with the surface or with the list of exceptions, each in a sentence."""
    found = list(found)
    now = listed(found)
    told = [
        f"{one.place} breaks the rule {one.rule!r}; lawful: {one.lawful}"
        for one in found
        if one.place not in exceptions.get(one.rule, {})
    ]
    for rule, places in exceptions.items():
        for place, lawful in places.items():
            if place not in now.get(rule, {}):
                told.append(f"{place} obeys the rule {rule!r} now: strike it out of {LIST.name}")
            elif lawful != now[rule][place]:
                told.append(f"{place}: {LIST.name} says {lawful!r}, lawful: {now[rule][place]}")
            if digest(rule, place) not in known:
                told.append(f"{place} is new in {LIST.name}: a new public name obeys the law")
    return told


def strike_out() -> None:
    """Take the names that obey out of the list."""
    now = listed(breaches(library()))
    kept = {
        rule: {place: now[rule][place] for place in places if place in now.get(rule, {})}
        for rule, places in excepted().items()
    }
    LIST.write_text(written({r: p for r, p in kept.items() if p}), encoding="utf-8")


if __name__ == "__main__":
    strike_out()
