"""Certificates of stored runs by the checks of today: `python tests/recertify.py [PATTERN ...]`.

Answers, metrics and all else of a run stay as they are. A run of which anything but the certificate
disagrees with its arrays, or whose certificate fails, is told and left: `make reference` makes it
anew. Certificates of studies repeat those of what they need, which therefore come first.
"""

from __future__ import annotations

import sys
from fnmatch import fnmatch
from graphlib import TopologicalSorter
from pathlib import Path

from workbench.bench.files import write_json
from workbench.bench.formats.crate import write_crate
from workbench.bench.project import registry
from workbench.bench.results import Run, read_json
from workbench.bench.store import seal
from workbench.bench.verify import Verification, finished_folders, verify_folder

REFERENCE = Path(__file__).parents[1] / "results" / "reference"


def needed_first(folders: list[Path]) -> list[Path]:
    """The folders in an order in which each run comes after the runs that it needs."""
    by_key = {path.name: path for path in folders}
    assert len(by_key) == len(folders), "two runs have one key"
    needs = {}
    for key, path in by_key.items():
        given = read_json(path / "run.json")["needs"].values()
        needs[key] = [one for keys in given for one in ([keys] if isinstance(keys, str) else keys)]
    return [by_key[key] for key in TopologicalSorter(needs).static_order() if key in by_key]


def recertified(found: Verification) -> bool:
    """Whether the certificate of a verified run was made anew."""
    apart = [text for text in found.problems if text.startswith("certificate.json: ")]
    if not apart or len(apart) < len(found.problems):
        return False
    assert found.certificate is not None
    if not found.certificate.holds:
        return False
    run = read_json(found.path / "run.json")
    write_json(found.path / "certificate.json", found.certificate.to_json())
    write_crate(found.path, run, registry().find(run["problem"]).entry.help)
    seal(found.path)
    return True


def main(patterns: list[str]) -> int:
    """Number of runs that are left with problems."""
    folders = [
        path
        for path in finished_folders(REFERENCE)
        if not patterns or any(fnmatch(Run(path).problem, pattern) for pattern in patterns)
    ]
    left = 0
    for path in needed_first(folders):
        found = verify_folder(path)
        if recertified(found):
            print(f"{path.relative_to(REFERENCE)}: certificate made anew", flush=True)
        elif found.problems:
            print(found)
            left += 1
    return left


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
