"""The caller's folders, solvers and code, which its workers must share."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from workbench.bench.code import source_digests
from workbench.bench.project import (
    registry,
    results_root,
    use_problems,
    use_results,
    use_solvers,
    used_solvers,
)
from workbench.bench.question import canonical, digest
from workbench.bench.run import environment
from workbench.errors import ClusterError


@dataclass(frozen=True)
class Site:
    """Problem folders, results folder and solvers."""

    folders: tuple[Path, ...]
    results: Path
    solvers: tuple[str, ...] = ()

    @classmethod
    def here(cls) -> Site:
        return cls(tuple(registry().roots), results_root().absolute(), used_solvers())

    def enter(self) -> None:
        """Make this process use the same folders and solvers."""
        if self in _entered:
            return
        _entered[:] = [self]
        use_solvers(self.solvers)
        if tuple(registry().roots) != self.folders:
            use_problems(self.folders)
        if results_root().absolute() != self.results:
            use_results(self.results)


_entered: list[Site] = []
"""The site that this process uses now; remembered, since scanning the problem folders takes
milliseconds.
"""


@dataclass(frozen=True)
class SameCode:
    """A caller's site, versions and sources; a worker elsewhere must have the same ones.

    ``path`` lists the folders from which the caller imports modules.
    """

    site: Site
    versions: tuple[tuple[str, str], ...]
    sources: str
    path: tuple[str, ...]

    @classmethod
    def here(cls) -> SameCode:
        site = Site.here()
        path = tuple(str(Path(folder).absolute()) for folder in sys.path)
        return cls(site, tuple(environment().items()), _sources(site.folders), path)

    def __call__(self) -> None:
        """Enter the site; `ClusterError` says what is missing or different."""
        for folder in (*self.site.folders, self.site.results):
            if not folder.is_dir():
                raise ClusterError(
                    f"there is no folder {folder}; workers need the problems and the results of "
                    "their caller under the same names, as on a shared file system"
                )
        _need_same(dict(self.versions), environment())
        if _sources(self.site.folders) != self.sources:
            raise ClusterError(
                "the sources of the workbench or of the problem folders are others than the "
                "caller's: install the same ones"
            )
        sys.path += [folder for folder in self.path if folder not in sys.path]
        self.site.enter()


def _need_same(there: Mapping[str, str], here: Mapping[str, str]) -> None:
    names = sorted(there.keys() | here.keys())
    apart = [
        f"{name} {here.get(name, 'missing')} instead of {there.get(name, 'none')}"
        for name in names
        if here.get(name) != there.get(name)
    ]
    if apart:
        raise ClusterError(f"it has {', '.join(apart)}; answers would not be the same")


def _sources(folders: tuple[Path, ...]) -> str:
    """Hash of the sources of the workbench and of problem folders."""
    return digest(canonical(source_digests(folders)))
