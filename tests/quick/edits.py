"""What an edit changes: definitions of sources, pages, data; and the tests that these reach."""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from quick.chosen import FAR, Chosen
from quick.files import read
from quick.graph import ANYTHING, FAMILIES, Graph, Node
from quick.sources import BODY, TEXT, texts


def changed_files(root: Path) -> list[str]:
    """Files that differ from the last commit, new and deleted ones among them."""
    words = ["git", "status", "--porcelain", "--untracked-files=all", "--no-renames", "-z"]
    lines = subprocess.run(words, cwd=root, capture_output=True, text=True, check=True).stdout
    return sorted(line[3:] for line in lines.split("\0") if line)


def committed(root: Path, file: str) -> str:
    """Text of a file at the last commit; empty where there was none."""
    words = ["git", "show", f"HEAD:{file}"]
    done = subprocess.run(words, cwd=root, capture_output=True, check=False)
    return done.stdout.decode(errors="replace") if done.returncode == 0 else ""


def edited(graph: Graph, before: Mapping[str, str]) -> set[Node]:
    """Nodes that differ from what they were, given the earlier texts of the edited files."""
    found: set[Node] = set()
    for file, text in before.items():
        if file in ANYTHING:
            found |= graph.tests
        elif file not in graph.sources:
            found |= graph.readers(file)
        elif file.endswith(".py"):
            now = "" if file in graph.gone else (graph.root / file).read_text(encoding="utf-8")
            found |= set(_definitions(file, now, text))
        else:
            found.add((file, BODY))
    return found


def _definitions(file: str, now: str, before: str) -> Iterator[Node]:
    """Definitions of a module that differ, or that use a name which is imported from elsewhere."""
    yield (file, TEXT)
    new, old = read(file, now), read(file, before)
    moved = {name for name, _ in new.bound.items() ^ old.bound.items()}
    for name, definition in new.definitions.items():
        if moved.intersection(chain.partition(".")[0] for chain in definition.names):
            yield (file, name)
    same = texts(now).items() & texts(before).items()
    for name in {*new.definitions, *old.definitions, *moved} - {name for name, _ in same}:
        yield (file, name)


def chosen(graph: Graph, edits: Iterable[Node]) -> Chosen:
    """The tests that edited definitions reach."""
    found = graph.leading_to(edits)
    wide = graph.leading_to(one for one in FAMILIES if not graph.edges[one].isdisjoint(found))
    tests: dict[str, dict[str, int]] = {}
    for node in graph.tests & (found.keys() | wide.keys()):
        tests.setdefault(node[0], {})[node[1]] = found.get(node, FAR)
    reached = [label for label, nodes in graph.labels.items() if not found.keys().isdisjoint(nodes)]
    return Chosen(tests, tuple(graph.labels), tuple(reached))
