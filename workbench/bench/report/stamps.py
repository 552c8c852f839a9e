"""One hash of everything that the look of a run depends on.

Nothing is redrawn while it is equal.
"""

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
"""Packages that draw; runs do not record their versions."""


def drawing_code() -> str:
    """Hash of the sources of the workbench and of all problem folders, and of versions."""
    found = source_digests(registry().roots)
    drawing = {name: version(name) for name in DRAWING}
    return digest(canonical([found, versions() | drawing]))


def stamps(runs: Mapping[Path, Run], code: str) -> dict[Path, str]:
    """One hash for each run: its files, those of the runs it needs, its data, and the code.

    Parameters
    ----------
    runs
        The runs, by their folders; the runs that a run needs are found among them by key.
    code
        Result of `drawing_code`.
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
    """The stored runs that a run needs, directly or through others."""
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
    """Hashes of the present data files of a run's problem."""
    if run.problem not in registry().entries:
        return {}
    try:
        return registry().find(run.problem).data_hashes()
    except WorkbenchError as error:  # its figures cannot be drawn then; the page says so
        return {"error": str(error)}
