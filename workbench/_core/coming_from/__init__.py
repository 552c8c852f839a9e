"""What functions of other tools are called here: one table, for the pages and for messages.

A file of this folder, TOML, holds what one page of the documentation shows, row by row; its name is
that of the page. Whoever asks a room for a name that it lacks is answered from the same rows.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).parent
GUIDES = "docs/coming-from"
"""Folder of the pages in the repository."""


@dataclass(frozen=True)
class Row:
    """Functions of another tool, what they are here, and a line that runs.

    ``names`` are those that its users type; none where no name stands for what is meant. ``here``
    are names below `workbench`, the nearest first; none where it is not here. ``line`` is an
    expression in the names of the page's ``setup``. ``remark`` says how the two differ or, where it
    is not here, what to use. ``call`` is shown on the page instead of the names.
    """

    names: tuple[str, ...]
    here: tuple[str, ...]
    line: str
    remark: str = ""
    call: str = ""


@dataclass(frozen=True)
class Guide:
    """What a page shows: the statements that its lines stand on, and its rows."""

    page: str
    tool: str
    setup: str
    rows: tuple[Row, ...]


@cache
def guides() -> tuple[Guide, ...]:
    """The guides of all tools, of which the first answers where several know a name."""
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
    """Where to go for a name that users of another tool type; empty for one that none has."""
    for guide in guides():
        for row in guide.rows:
            if name in row.names:
                told = f"is not here; {row.remark}; for example `{row.line}`"
                if row.here:
                    told = f"is workbench.{row.here[0]} here, as in `{row.line}`"
                return f"{guide.tool}'s {name} {told}; guide: {GUIDES}/{guide.page}.md"
    return ""
