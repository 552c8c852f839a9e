"""What is run under each emulation: stored runs, printed numbers, all other tests, the chain."""

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
        workers = 2 // self.emulation.threads
        pytest = [python, "-m", "pytest", "-n", str(workers), "--dist", "worksteal", "-rfE"]
        chosen = ["-m", "not slow"] if self.kind == "tests" else []
        files = files_of(self.kind)[self.chunk :: CHUNKS[self.kind]]
        # Processor seconds are those of another processor, and of threads that wait for each other.
        left_out = ["-p", "no:cacheprovider", "-p", "no:cpu-seconds"]
        return [*pytest, *left_out, *chosen, *files]


PARTS = {
    part.name: part
    for emulation in EMULATIONS.values()
    for kind, chunks in CHUNKS.items()
    for part in (Part(emulation, kind, chunk) for chunk in range(chunks))
}
