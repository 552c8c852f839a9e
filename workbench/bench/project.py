"""Where things are: the problem folders and the results folder of the project at hand.

A project is the nearest folder upwards whose pyproject.toml has a table ``[tool.workbench]``::

    [tool.workbench]
    problems = ["my_problems"]
    results = "results"
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import workbench.plants
from workbench.bench.registry import Registry
from workbench.bench.trust.untrusted import possible_path
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
            table = _table(file)
            if table is not None:
                folders, results = table
                return cls(tuple(candidate / name for name in folders), candidate / results)
        return cls((), folder / "results")


def _table(file: Path) -> tuple[list[str], str] | None:
    """Problem folders and results folder of a pyproject.toml, None where it has no table of ours.

    Raises
    ------
    RegistryError
        The file cannot be read or is no TOML, or an entry has another type.
    """
    try:
        tool = tomllib.loads(file.read_text(encoding="utf-8")).get("tool", {})
    except (OSError, ValueError, RecursionError) as error:
        raise RegistryError(f"{file}: {error}") from None
    if not isinstance(tool, dict) or "workbench" not in tool:
        return None
    table = tool["workbench"]
    if not isinstance(table, dict):
        raise RegistryError(f"{file}: tool.workbench must be a table, not {table!r}")
    problems, results = table.get("problems", []), table.get("results", "results")
    if not isinstance(problems, list) or not all(map(_folder_name, problems)):
        raise RegistryError(f"{file}: problems must be a list of folders, not {problems!r}")
    if not _folder_name(results):
        raise RegistryError(f"{file}: results must be a folder, not {results!r}")
    return problems, results


def _folder_name(name: object) -> bool:
    return isinstance(name, str) and bool(name) and "\0" not in name


def built_in() -> Path:
    """The problems that come with the workbench: inside the wheel, or beside the sources."""
    return Path(workbench.plants.__path__[0])


_added: list[Path] = []


def add_problems(folder: str | Path) -> None:
    """Discover problems in one more folder, for the rest of this process."""
    try:
        path = Path(folder).resolve()
        there = path.is_dir()
    except (OSError, ValueError, RuntimeError):  # a name that no folder can have
        there = False
    if not there:
        raise RegistryError(f"problem folder {folder} does not exist")
    if path not in _added:
        _added.append(path)


_instead: list[Path] = []


def use_problems(folders: Iterable[Path]) -> None:
    """Discover problems in these folders and no others, for the rest of this process."""
    _instead[:] = folders


def added_problems() -> tuple[Path, ...]:
    """The folders added so far."""
    return tuple(_added)


def registry() -> Registry:
    """The registry over the built-in, the project's and the added folders."""
    roots = _instead or [built_in(), *Project.around(Path.cwd()).problems, *_added]
    unique = tuple(dict.fromkeys(path.resolve() for path in roots))
    state = tuple(
        (file, file.lstat().st_mtime_ns) for root in unique for file in sorted(root.rglob("*.py"))
    )
    return _registry(unique, state)


@lru_cache(maxsize=1)
def _registry(roots: tuple[Path, ...], state: tuple[tuple[Path, int], ...]) -> Registry:
    """The same registry as long as no file was added, removed or edited."""
    return Registry(list(roots))


RESULTS = "WORKBENCH_RESULTS"


def use_results(folder: str | Path) -> None:
    """Keep results in this folder, for the rest of this process and those it starts."""
    os.environ[RESULTS] = str(possible_path(folder).resolve())


def results_root() -> Path:
    """The results folder: the environment's WORKBENCH_RESULTS, else the project's."""
    override = os.environ.get(RESULTS)
    return Path(override) if override else Project.around(Path.cwd()).results
