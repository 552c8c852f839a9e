"""Draw the house: which room of the library stands on which, as `lint-imports` holds it.

python docs/_tools/house.py    # writes docs/house.svg
"""

from __future__ import annotations

import ast
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "house.svg"
FLOORS = {
    "cli": "what a user meets",
    "diagnosis": "rooms of the field",
    "conic": "what decides",
    "systems": "ground",
}
"""First layer of each floor, from the top, and the floor's name."""
LINE, WIDTH, NAMES, WORDS = 19, 1000, 110, 330
"""Height of a line, width, and where names and words begin [px]."""
COLOURS = ("#e8eef7", "#f7f3e8", "#e9f3e6", "#eeeeee")


def layers() -> list[str]:
    """The rooms from the top down, those of one layer in one entry."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: list[str] = project["tool"]["importlinter"]["contracts"][0]["layers"]
    return [layer for layer in found if layer != "__main__"]


def first_line(room: str) -> str:
    """What the docstring of a room or module says first."""
    place = ROOT / "workbench" / room
    source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    said = ast.get_docstring(ast.parse(source.read_text(encoding="utf-8")))
    assert said, f"{source} has no docstring"
    return said.splitlines()[0].rstrip(".")


def drawn() -> str:
    """The picture as SVG."""
    rows: list[tuple[str, str]] = []
    floors: list[tuple[str, int]] = []
    for layer in layers():
        if layer in FLOORS:
            floors.append((FLOORS[layer], len(rows)))
        rooms = [room.strip() for room in layer.replace(":", "|").split("|")]
        rows += [(room, first_line(room)) for room in rooms]
    height = (len(rows) + 1) * LINE
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'font-family="sans-serif" font-size="12">'
    ]
    ends = [*(first for _, first in floors[1:]), len(rows)]
    for (name, first), last, colour in zip(floors, ends, COLOURS, strict=True):
        top, size = first * LINE + LINE // 2, (last - first) * LINE
        parts.append(f'<rect x="0" y="{top}" width="{WIDTH}" height="{size}" fill="{colour}"/>')
        middle = top + size / 2
        parts.append(
            f'<text x="50" y="{middle:g}" text-anchor="middle" font-weight="bold" '
            f'transform="rotate(-90 50 {middle:g})">{escape(name)}</text>'
        )
    for number, (room, words) in enumerate(rows, 1):
        y = number * LINE + 4
        parts.append(f'<text x="{NAMES}" y="{y}" font-family="monospace">{escape(room)}</text>')
        parts.append(f'<text x="{WORDS}" y="{y}">{escape(words)}</text>')
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
