"""Errors in the code that judges, each a change of its text, and the test that must notice it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

from mutated import MUTANT

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
LONGEST = 600.0
"""Time [s] that the test may take, on a machine that does much else."""
TESTS_FAILED = 1
"""Pytest's exit status; all others but 0 say that it could not run them."""


@dataclass(frozen=True)
class Edit:
    """An error: ``old`` stands once in a module below `workbench`, and ``new`` takes its place.

    ``test`` is what notices it: pytest's name of a test, below the folder of tests.
    """

    name: str
    module: str
    old: str
    new: str
    test: str

    def __str__(self) -> str:
        return f"{self.module}: {self.name}"

    @property
    def text(self) -> str:
        """The module as it is."""
        return (ROOT / "workbench" / f"{self.module.replace('.', '/')}.py").read_text("utf-8")


def edits() -> dict[str, list[Edit]]:
    """The errors by room: those of each file of the folder beside this one."""
    found = {}
    for file in sorted((HERE / "edits").glob("*.toml")):
        told = tomllib.loads(file.read_text("utf-8"))
        found[file.stem] = [
            Edit(module=module, **one) for module, each in told.items() for one in each
        ]
    return found


def noticed(edit: Edit) -> tuple[bool, str]:
    """Whether the test of an error fails with it, and what was printed.

    The test runs in a process of its own, which imports the changed module. A process that cannot
    run it notices nothing.
    """
    change = {"module": f"workbench.{edit.module}", "old": edit.old, "new": edit.new}
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-x", "-p", "mutated", "-p", "no:cacheprovider", "-m",
         "not slow", "--tb=line", f"tests/{edit.test}"],
        cwd=ROOT,
        env=os.environ | {MUTANT: json.dumps(change), "PYTHONPATH": str(HERE)},
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )  # fmt: skip
    said = run.stdout + run.stderr
    return run.returncode == TESTS_FAILED and "FAILED tests/" in run.stdout, said
