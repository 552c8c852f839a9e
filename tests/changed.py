"""Which tests the changes since the last commit can reach, for `make quick`.

Prints the files of these tests, and writes which of their tests to run, the nearest first, into the
file that it is given; `conftest.py` reads it. What can be reached is read from the sources: see
`quick/graph.py`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from quick.edits import changed_files, chosen, committed, edited
from quick.graph import Graph

ROOT = Path(__file__).parents[1]


def main(told: Path) -> None:
    """Write the chosen tests into a file, and print the names of their files."""
    before = {file: committed(ROOT, file) for file in changed_files(ROOT)}
    gone = {file: text for file, text in before.items() if not (ROOT / file).is_file()}
    graph = Graph(ROOT, gone)
    found = chosen(graph, edited(graph, before))
    told.parent.mkdir(exist_ok=True)
    told.write_text(json.dumps(found.to_json()), encoding="utf-8")
    tests = sum(map(len, found.tests.values()))
    say = f"{len(before)} files changed; they reach {tests} tests in {len(found.tests)} files"
    print(say, file=sys.stderr)
    print("\n".join(sorted(found.tests)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
