"""How functions of other tools are called here: one table, used for pages and for messages.

Each TOML file of this folder holds one page of the documentation, row by row, and has the name of
that page. The same rows answer a user who asks a room for a name that it lacks.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).parent
GUIDES = "docs/coming-from"
"""Folder of these pages in the repository."""


@dataclass(frozen=True)
class Row:
    """Functions of another tool, their counterparts here, and a line that runs.

    ``names`` are the names in the other tool; empty if no single name stands for the row. ``here``
    are names below `workbench`, the closest first; empty if there is no counterpart. ``line`` is an
    expression in the names of the page's ``setup``. ``remark`` says how the two differ or, without
    a counterpart, what to use instead. ``call`` is shown on the page instead of the names.
    """

    names: tuple[str, ...]
    here: tuple[str, ...]
    line: str
    remark: str = ""
    call: str = ""


@dataclass(frozen=True)
class Guide:
    """Content of a page: the statements that its lines need, and its rows."""

    page: str
    tool: str
    setup: str
    rows: tuple[Row, ...]


@cache
def guides() -> tuple[Guide, ...]:
    """The guides of all tools; if several know a name, the first one answers."""
    found = []
    for file in sorted(FOLDER.glob("*.toml")):
        told = tomllib.loads(file.read_text(encoding="utf-8"))
        rows = (
            Row(**row | {"names": tuple(row["names"]), "here": tuple(row["here"])})
            for row in told["row"]
        )
        rank, setup = told["rank"], told["setup"].strip()
        found.append((rank, Guide(file.stem, told["tool"], setup, tuple(rows))))
    return tuple(guide for _, guide in sorted(found, key=lambda pair: pair[0]))


def guidance(name: str) -> str:
    """Advice for a user who types a name of another tool; empty if no tool has that name."""
    for guide in guides():
        for row in guide.rows:
            if name in row.names:
                told = f"is not here; {row.remark}; for example `{row.line}`"
                if row.here:
                    told = f"is workbench.{row.here[0]} here, as in `{row.line}`"
                return f"{guide.tool}'s {name} {told}; guide: {GUIDES}/{guide.page}.md"
    return ""
