"""What the look of a run depends on, as one hash: while it stays, nothing is drawn again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path

from workbench.bench.code import source_digests
from workbench.bench.project import registry
from workbench.bench.question import canonical, digest
from workbench.bench.report.words import listed
from workbench.bench.results import Run
from workbench.bench.store import CHECKSUMS
from workbench.errors import WorkbenchError
from workbench.solvers import versions

DRAWING = ("matplotlib", "pillow")
"""Packages that draw, beside those whose versions a run records."""


def drawing_code() -> str:
    """Hash of the sources of the workbench and of all problem folders, and of versions."""
    found = source_digests(registry().roots)
    drawing = {name: version(name) for name in DRAWING}
    return digest(canonical([found, versions() | drawing]))


def stamps(runs: Mapping[Path, Run], code: str) -> dict[Path, str]:
    """A hash for every run: its files, those of all runs that it stands on, its data, the code.

    Parameters
    ----------
    runs
        The runs by their folders; those among them that a run stands on are found by their keys.
    code
        `drawing_code`.
    """
    sealed = {folder: digest((folder / CHECKSUMS).read_bytes()) for folder in runs}
    by_key: dict[str, list[Run]] = {}
    for run in runs.values():
        by_key.setdefault(run.key, []).append(run)
    return {
        folder: digest(
            canonical([code, sealed[folder], _data(run), sorted(
                (need.key, sealed[need.path]) for need in _needs(run, by_key)
            )])
        )
        for folder, run in runs.items()
    }  # fmt: skip


def _needs(run: Run, by_key: Mapping[str, list[Run]]) -> Iterator[Run]:
    """The stored runs that a run stands on, and those that they stand on."""
    waiting, met = [run], {run.path}
    while waiting:
        needs = waiting.pop().info["needs"].values()
        for key in (key for need in needs for key in listed(need)):
            for one in by_key.get(key, []):
                if one.path not in met:
                    met.add(one.path)
                    waiting.append(one)
                    yield one


def _data(run: Run) -> dict[str, str]:
    """Hashes of the data files of a run's problem as they are now."""
    if run.problem not in registry().entries:
        return {}
    try:
        return registry().find(run.problem).data_hashes()
    except WorkbenchError as error:  # then its figures cannot be drawn, which is told there
        return {"error": str(error)}
