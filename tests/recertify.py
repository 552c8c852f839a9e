"""Certificates of stored runs by the checks of today: `python tests/recertify.py [PATTERN ...]`.

Answers, metrics and all else of a run stay as they are. A run of which anything but the certificate
disagrees with its arrays, or whose certificate fails, is told and left: `make reference` makes it
anew. Studies have the certificates of what they need, so that those come first.
"""

from __future__ import annotations

import sys
from fnmatch import fnmatch
from pathlib import Path

from workbench.bench.files import write_json
from workbench.bench.formats.crate import write_crate
from workbench.bench.project import registry
from workbench.bench.results import Run, read_json
from workbench.bench.store import seal
from workbench.bench.verify import finished_folders, verify_folder

REFERENCE = Path(__file__).parents[1] / "results" / "reference"
PASSES = 8
"""Most studies that feed each other in a row."""


def recertified(path: Path) -> bool:
    """Whether the certificate of a run was made anew."""
    found = verify_folder(path)
    apart = [text for text in found.problems if text.startswith("certificate.json: ")]
    if not apart or len(apart) < len(found.problems):
        return False
    assert found.certificate is not None
    if not found.certificate.holds:
        return False
    run = read_json(path / "run.json")
    write_json(path / "certificate.json", found.certificate.to_json())
    write_crate(path, run, registry().find(run["problem"]).entry.help)
    seal(path)
    return True


def main(patterns: list[str]) -> int:
    """Number of runs that are left with problems."""
    folders = [
        path
        for path in finished_folders(REFERENCE)
        if not patterns or any(fnmatch(Run(path).problem, pattern) for pattern in patterns)
    ]
    for _ in range(PASSES):
        made = [path for path in folders if recertified(path)]
        for path in made:
            print(f"{path.relative_to(REFERENCE)}: certificate made anew")
        if not made:
            break
    left = [found for found in map(verify_folder, folders) if found.problems]
    for found in left:
        print(found)
    return len(left)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
