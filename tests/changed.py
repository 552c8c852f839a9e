"""Test files of what changed since the last commit: themselves, and those that import it."""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[1]


def changed() -> list[Path]:
    """Python files that differ from the last commit, new ones among them."""
    words = ["git", "status", "--porcelain", "--untracked-files=all", "--no-renames"]
    lines = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    files = (ROOT / line[3:].strip('"') for line in lines.splitlines())
    return [file for file in files if file.suffix == ".py" and file.is_file()]


def module_of(file: Path) -> str:
    """The name under which a test imports a file."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    if parts[0] == "problems":
        parts = ("workbench", "plants", *parts[1:])
    return ".".join(part for part in parts if part != "__init__")


def imported(file: Path) -> set[str]:
    """Modules that a file imports, and the names from them that may be modules."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
        elif isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
    return found


def main() -> None:
    tests = ROOT / "tests"
    edited = changed()
    chosen = {file for file in edited if tests in file.parents and file.name.startswith("test_")}
    modules = {module_of(file) for file in edited if tests not in file.parents}
    stems = {file.stem for file in edited}
    for file in tests.rglob("test_*.py"):
        if modules & imported(file) or file.stem.removeprefix("test_") in stems:
            chosen.add(file)
    print("\n".join(str(file.relative_to(ROOT)) for file in sorted(chosen)))


if __name__ == "__main__":
    main()
