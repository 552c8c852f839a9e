"""Docstrings of the library as reStructuredText: what is written for `help()` is safe there."""

from __future__ import annotations

import re
from typing import Any

NOT_CODE = re.compile(r"(``.*?``|`[^`]*`)")
"""Splits a paragraph into what is code and what is not."""


def escaped(text: str) -> str:
    """Text in which | and * outside of code mean themselves, as in |y| and M* D M."""
    parts = NOT_CODE.split(text)
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"(?<!\\)([|*])", r"\\\1", parts[i])
    return re.sub(r"(`[^`]+`)(?=\w)", r"\1\\ ", "".join(parts))  # as in `Rational`s


def with_formulas(lines: list[str]) -> list[str]:
    """Lines in which what is set in by four blanks, above the first section, is a literal block."""
    sections = [i for i, line in enumerate(lines) if i and line and not line.strip("-")]
    end = sections[0] - 1 if sections else len(lines)
    found: list[str] = []
    inside = False
    for line in lines[:end]:
        indented = line.startswith("    ")
        if indented and not inside:
            found += ["", "::", ""]
        elif inside and line and not indented:
            found.append("")
        found.append(line)
        inside = indented or (inside and not line)
    return found + ([""] if inside else []) + lines[end:]


def made_safe(
    app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str], *_: Any
) -> None:
    """Escape what reStructuredText would take for markup; formulas and sessions stay literal."""
    literal = session = False
    kept: list[str] = []
    for line in with_formulas(lines):
        if literal and line.strip() and not line.startswith(" "):
            literal = False
        # What a session prints belongs to it, up to the next empty line.
        session = line.lstrip().startswith(">>>") or (session and bool(line.strip()))
        kept.append(line if literal or session else escaped(line))
        literal = literal or line.rstrip().endswith("::")
    lines[:] = kept


def setup(app: Any) -> dict[str, bool]:
    """Connect before napoleon, whose own markup must not be escaped."""
    app.connect("autodoc-process-docstring", made_safe, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
