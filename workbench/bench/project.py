"""Where things are: the problem folders and the results folder of the project at hand.

A project is the nearest folder upwards whose pyproject.toml has a table ``[tool.workbench]``::

    [tool.workbench]
    problems = ["my_problems"]
    results = "results"
"""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import workbench.plants
from workbench.bench.registry import Registry
from workbench.errors import RegistryError


@dataclass(frozen=True)
class Project:
    """Folders of the project at hand."""

    problems: tuple[Path, ...]
    results: Path

    @classmethod
    def around(cls, folder: Path) -> Project:
        """The project that a folder lies in; without one, results stand in the folder itself."""
        for candidate in (folder, *folder.parents):
            file = candidate / "pyproject.toml"
            if not file.is_file():
                continue
            try:
                table = tomllib.loads(file.read_text(encoding="utf-8"))
            except tomllib.TOMLDecodeError as error:
                raise RegistryError(f"{file}: {error}") from None
            table = table.get("tool", {}).get("workbench")
            if table is not None:
                folders = table.get("problems", [])
                if not isinstance(folders, list):
                    raise RegistryError(f"{file}: problems must be a list, not {folders!r}")
                problems = tuple(candidate / name for name in folders)
                return cls(problems, candidate / table.get("results", "results"))
        return cls((), folder / "results")


def built_in() -> Path:
    """The problems that come with the workbench: inside the wheel, or beside the sources."""
    return Path(workbench.plants.__path__[0])


_added: list[Path] = []


def add_problems(folder: str | Path) -> None:
    """Discover problems in one more folder, for the rest of this process."""
    path = Path(folder).resolve()
    if not path.is_dir():
        raise RegistryError(f"problem folder {folder} does not exist")
    if path not in _added:
        _added.append(path)


def added_problems() -> tuple[Path, ...]:
    """The folders added so far."""
    return tuple(_added)


def registry() -> Registry:
    """The registry over the built-in, the project's and the added folders."""
    roots = [built_in(), *Project.around(Path.cwd()).problems, *_added]
    unique = tuple(dict.fromkeys(path.resolve() for path in roots))
    state = tuple(
        (file, file.stat().st_mtime_ns) for root in unique for file in sorted(root.rglob("*.py"))
    )
    return _registry(unique, state)


@lru_cache(maxsize=1)
def _registry(roots: tuple[Path, ...], state: tuple[tuple[Path, int], ...]) -> Registry:
    """The same registry as long as no file was added, removed or edited."""
    return Registry(list(roots))


RESULTS = "WORKBENCH_RESULTS"


def use_results(folder: str | Path) -> None:
    """Keep results in this folder, for the rest of this process and those it starts."""
    os.environ[RESULTS] = str(Path(folder).resolve())


def results_root() -> Path:
    """The results folder: the environment's WORKBENCH_RESULTS, else the project's."""
    override = os.environ.get(RESULTS)
    return Path(override) if override else Project.around(Path.cwd()).results
