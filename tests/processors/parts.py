"""What is run in parts: every test on this processor; and under each emulation of another one
stored runs, printed numbers, all other tests, the chain."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from emulations import EMULATIONS, ROOT, Emulation

STORED_RUNS = "tests/test_reference.py"
NUMBERS = re.compile(
    r'"reference"|def \w+\([^)]*\b(reference|answered)\b|"docs"|notebook|"data"|\b[Tt]hesis\b'
)
"""Words of a test that compares with what is stored in results or data, or printed on a page, in a
notebook or in the thesis."""
CHAIN = "cd/focus/fault-filter"
"""A problem that needs a cover for control, which needs a cover."""
CHUNKS = {"stored": 1, "numbers": 3, "tests": 3, "chain": 1}
"""Parts of each kind, so that one takes less than half an hour on two cores."""
HERE = "here"
"""This processor as it is, where every test is run, room by room."""
LAWS = "laws"
"""The tests that stand in no room."""
LARGE = {"problems": 8, "synthesis": 4, "mu": 3, "uncertainty": 2, "bench": 2, "identification": 2}
"""Parts of a room whose tests take more than half an hour on two cores."""


def files_of_tests() -> list[str]:
    """Files of tests relative to the checkout."""
    return sorted(file.relative_to(ROOT).as_posix() for file in (ROOT / "tests").rglob("test_*.py"))


@cache
def files_of(kind: str) -> list[str]:
    """Files of one kind of tests; each file is of exactly one."""
    others = [name for name in files_of_tests() if name != STORED_RUNS]
    numbers = [name for name in others if NUMBERS.search((ROOT / name).read_text("utf-8"))]
    return {
        "stored": [STORED_RUNS],
        "numbers": numbers,
        "tests": [name for name in others if name not in numbers],
    }[kind]


@cache
def files_of_rooms() -> dict[str, list[str]]:
    """Files of all tests by room: the folder below `tests` that they stand in."""
    rooms: dict[str, list[str]] = {}
    for name in files_of_tests():
        _, room, *inner = name.split("/")
        rooms.setdefault(room if inner else LAWS, []).append(name)
    return rooms


def pytest_of(python: str, workers: int, *words: str) -> list[str]:
    """The command of tests, which names what fails."""
    # Limits of processor seconds are for `make test` on an idle processor of the usual kind.
    options = ["-n", str(workers), "--dist", "worksteal", "-rfE", "-p", "no:cpu-seconds"]
    return [python, "-m", "pytest", *options, *words]


@dataclass(frozen=True)
class Part:
    """A kind of check, or a chunk of it, under one emulation."""

    emulation: Emulation
    kind: str
    chunk: int

    @property
    def name(self) -> str:
        counted = f"-{self.chunk + 1}" if CHUNKS[self.kind] > 1 else ""
        return f"{self.emulation.name}/{self.kind}{counted}"

    def command(self, results: Path) -> list[str]:
        """What is run; ``results`` is a folder for the runs of a chain."""
        python = str(ROOT / self.emulation.venv / "bin" / "python")
        if self.kind == "chain":
            return [python, "-m", "workbench", "--results", str(results), "run", CHAIN]
        chosen = ["-m", "not slow"] if self.kind == "tests" else []
        files = files_of(self.kind)[self.chunk :: CHUNKS[self.kind]]
        workers = 2 // self.emulation.threads
        return pytest_of(python, workers, "-p", "no:cacheprovider", *chosen, *files)


@dataclass(frozen=True)
class Room:
    """Every test of a room, or of a chunk of it, on this processor as it is."""

    room: str
    chunk: int

    emulation = None

    @property
    def name(self) -> str:
        return f"{HERE}/{self.room}" + (f"-{self.chunk + 1}" if self.room in LARGE else "")

    def command(self, results: Path) -> list[str]:
        """What is run; it makes no runs that are kept."""
        files = files_of_rooms()[self.room][self.chunk :: LARGE.get(self.room, 1)]
        return pytest_of(str(ROOT / ".venv" / "bin" / "python"), 2, *files)


PARTS: dict[str, Part | Room] = {
    one.name: one
    for room in files_of_rooms()
    for one in (Room(room, chunk) for chunk in range(LARGE.get(room, 1)))
} | {
    part.name: part
    for emulation in EMULATIONS.values()
    for kind, chunks in CHUNKS.items()
    for part in (Part(emulation, kind, chunk) for chunk in range(chunks))
}
