"""The house explains itself: every folder says what it is, and none has too much in it."""

import ast
from pathlib import Path

from tables import each

ROOT = Path(__file__).parents[1]
ROOMS = sorted(
    file.parent for top in ("workbench", "problems") for file in (ROOT / top).rglob("__init__.py")
)
PARTS = "Takes", "Gives", "Rests on"
MODULES = 20
"""Modules in a folder from which on a reader must scroll."""


@each("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_says_what_it_is_and_is_not_crowded(room):
    assert ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    assert len(list(room.glob("*.py"))) <= MODULES


def test_a_room_says_in_five_lines_what_it_takes_gives_and_rests_on():
    for room in sorted((ROOT / "workbench").glob("*/__init__.py")):
        said = ast.get_docstring(ast.parse(room.read_text(encoding="utf-8"))).splitlines()
        starts = [line.split(":")[0] for line in said if line.startswith(PARTS)]
        assert starts == list(PARTS), room
        assert len([line for line in said if line]) <= 5, room


def test_every_module_says_what_it_is():
    silent = [
        file
        for room in ROOMS
        for file in room.glob("*.py")
        if not ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    ]
    assert not silent


def test_files_of_tests_have_names_of_their_own():
    """Without packages of tests, pytest imports each file by its bare name."""
    names = [file.name for file in (ROOT / "tests").rglob("test_*.py")]
    assert not {name for name in names if names.count(name) > 1}
