"""Runs as the report shows them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from workbench.bench.results import Run, runs_in, stored_runs
from workbench.bench.store import CHECKSUMS, FAILED, PARTIAL, REFERENCE
from workbench.errors import ResultError


@dataclass(frozen=True)
class ReportEntry:
    """A run as the page shows it.

    ``anchor`` is its place in the page, ``place`` its folder below the results folder, ``link``
    the way from the page to that folder.
    """

    run: Run
    failed: bool
    anchor: str
    place: str
    link: str | None

    @property
    def state(self) -> str:
        """The outcome of the certificate in one word."""
        if self.run.certificate is None:
            return "uncertified"
        if self.run.best_so_far:
            return "stopped"
        return "holds" if self.run.holds else "fails"

    @property
    def headline(self) -> tuple[str, float] | None:
        """Name and value of the key metric."""
        name = self.run.info["headline"]
        return (name, float(self.run.metrics[name])) if name in self.run.metrics else None

    @property
    def gap(self) -> float | None:
        certificate = self.run.certificate
        return certificate.gap.value if certificate and certificate.gap else None

    @property
    def log(self) -> str:
        try:
            return self.run.log
        except ResultError as error:
            return str(error)


def entries(root: Path, target: Path, pattern: str) -> Iterator[ReportEntry]:
    """Every run with a place in the page, by problem, method and key."""
    runs = [(run, False) for run in stored_runs(root, pattern)]
    runs += [(run, True) for run in failed_runs(root, pattern)]
    runs.sort(key=lambda pair: (pair[0].problem, pair[0].method or "", pair[0].path.as_posix()))
    taken: set[str] = set()
    for run, failed in runs:
        anchor = f"{run.problem}/{run.key}{FAILED if failed else ''}"
        while anchor in taken:  # a folder copied by hand keeps its problem and key
            anchor += "'"
        taken.add(anchor)
        place = run.path.relative_to(root).as_posix()
        yield ReportEntry(run, failed, anchor, place, _link(run.path, target.parent))


def _link(folder: Path, start: Path) -> str | None:
    """The way from one folder to another; None where it would spell out the whole machine."""
    folder, start = folder.absolute(), start.absolute()
    if folder.anchor != start.anchor or os.path.commonpath([folder, start]) == folder.anchor:
        return None
    return quote(Path(os.path.relpath(folder, start)).as_posix()) + "/"


def failed_runs(root: Path, pattern: str = "*") -> list[Run]:
    """The kept failures below a results folder whose problem fits a shell pattern."""
    aside = {root / PARTIAL, root / REFERENCE}
    folders = (
        file.parent
        for file in sorted(root.rglob(f"*{FAILED}/{CHECKSUMS}"))
        if not aside.intersection(file.parents)
    )
    return runs_in(folders, pattern)
