"""The files that the graph is made of, and the names under which they are imported and found."""

from __future__ import annotations

import fnmatch
import gc
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from quick.sources import VARIES, Source, read_page, read_python

CODE = ("workbench", "problems")
OTHERS = ("tests", "docs", "examples", "notebooks")
PATTERNS = ("*.py", "*.md", "*.ipynb")
MADE = re.compile(r"docs/(_build|course|gallery|reference/api)/|/(results|__pycache__|\.\w+)/")
"""What a build writes."""


@contextmanager
def without_collection() -> Iterator[None]:
    """Look for no garbage: of what is parsed nothing is, and looking takes as long again."""
    on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if on:
            gc.enable()


def source_files(root: Path) -> Iterator[str]:
    """Sources and pages below a root, relative to it."""
    for top in (*CODE, *OTHERS):
        for pattern in PATTERNS:
            for file in (root / top).rglob(pattern):
                name = file.relative_to(root).as_posix()
                if not MADE.search(name):
                    yield name
    yield from (file.name for pattern in ("*.py", "*.md") for file in root.glob(pattern))


def dotted(file: str) -> str:
    """The dotted path of a file."""
    return ".".join(part for part in Path(file).with_suffix("").parts if part != "__init__")


def module_of(file: str) -> str:
    """The name under which a file is imported; of others than the library's its own alone."""
    parts = list(Path(file).with_suffix("").parts)
    if parts[0] == "problems":
        parts = ["workbench", "plants", *parts[1:]]
    elif parts[0] != "workbench":
        parts = parts[-1:] if parts[-1] != "conftest" else [".".join(parts)]
    return ".".join(part for part in parts if part != "__init__")


def read(file: str, text: str) -> Source:
    """Facts of a file from its text."""
    if not file.endswith(".py"):
        return read_page(as_page(file, text))
    module = module_of(file)
    package = module if file.endswith("__init__.py") else module.rpartition(".")[0]
    return read_python(text, package if file.startswith(CODE) else "")


def as_page(file: str, text: str) -> str:
    """A notebook's cells as a page."""
    if not file.endswith(".ipynb"):
        return text
    fences = {"code": "```python\n{}\n```\n", "markdown": "{}\n"}
    cells = json.loads(text)["cells"]
    return "".join(fences[one["cell_type"]].format("".join(one["source"])) for one in cells)


def alike(one: str, other: str) -> bool:
    """Whether two patterns may name the same problem."""
    one, other = one.replace(VARIES, "*"), other.replace(VARIES, "*")
    return fnmatch.fnmatchcase(one, other) or fnmatch.fnmatchcase(other, one)
