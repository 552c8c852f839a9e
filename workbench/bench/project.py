"""The problem folders and the results folder of the current project.

A project is the nearest parent folder whose pyproject.toml has a table ``[tool.workbench]``::

    [tool.workbench]
    problems = ["my_problems"]
    results = "results"
    solvers = ["highs", "mosek"]

An installed package adds problems and solvers by entry points. One in the group
``workbench.problems`` names a package whose folder holds problems; one in the group
``workbench.solvers`` names a module that adds solvers or methods when it is imported.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

import workbench.plants
from workbench.bench.problem import helper_files
from workbench.bench.registry import Registry
from workbench.bench.trust.untrusted import possible_path
from workbench.errors import RegistryError, WorkbenchError


@dataclass(frozen=True)
class Project:
    """Folders of the current project."""

    problems: tuple[Path, ...]
    results: Path
    solvers: tuple[str, ...] = ()

    @classmethod
    def around(cls, folder: Path) -> Project:
        """The project that contains a folder.

        Without one, results are stored in the folder itself.
        """
        for candidate in (folder, *folder.parents):
            file = candidate / "pyproject.toml"
            if not file.is_file():
                continue
            table = _table(file, file.stat().st_mtime_ns)
            if table is not None:
                folders, results, solvers = table
                problems = tuple(candidate / name for name in folders)
                return cls(problems, candidate / results, tuple(solvers))
        return cls((), folder / "results")


@lru_cache(maxsize=16)
def _table(file: Path, changed_ns: int) -> tuple[list[str], str, list[str]] | None:
    """Problem folders, results folder and solvers of a pyproject.toml; None without our table.

    It is read again when the file has changed.

    Raises
    ------
    RegistryError
        The file cannot be read or is not TOML, or an entry has another type.
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
    solvers = table.get("solvers", [])
    if not isinstance(solvers, list) or not all(isinstance(name, str) for name in solvers):
        raise RegistryError(f"{file}: solvers must be a list of names, not {solvers!r}")
    return problems, results, solvers


def _folder_name(name: object) -> bool:
    return isinstance(name, str) and bool(name) and "\0" not in name


def built_in() -> Path:
    """The problems that belong to the workbench: inside the wheel, or beside the sources."""
    return Path(workbench.plants.__path__[0])


_added: list[Path] = []


def add_problems(folder: str | Path) -> None:
    """Use the problems of one more folder, for the rest of this process."""
    try:
        path = Path(folder).resolve()
        there = path.is_dir()
    except (OSError, ValueError, RuntimeError):  # not a possible name of a folder
        there = False
    if not there:
        raise RegistryError(f"problem folder {folder} does not exist")
    if path not in _added:
        _added.append(path)


_instead: list[Path] = []


def use_problems(folders: Iterable[Path]) -> None:
    """Use the problems of these folders and no others, for the rest of this process."""
    _instead[:] = folders


def added_problems() -> tuple[Path, ...]:
    """The folders added so far."""
    return tuple(_added)


def registry() -> Registry:
    """The registry over the built-in, the project's and the added folders."""
    project = Project.around(Path.cwd())
    brought, unfit = _package_folders()
    wrong = (*unfit, *_load_packages(), *_use_available_solvers(project.solvers))
    roots = _instead or [built_in(), *brought, *project.problems, *_added]
    unique = tuple(dict.fromkeys(path.resolve() for path in roots))
    files = [str(file) for file in helper_files() if file.is_file()]
    # The time of a folder tells of files that an axis may be made of.
    for root in unique:
        for folder, inner, names in os.walk(root):
            if "__pycache__" in inner:
                inner.remove("__pycache__")
            files.append(folder)
            files += [f"{folder}{os.sep}{name}" for name in names if name.endswith(".py")]
    state = tuple([(file, os.lstat(file).st_mtime_ns) for file in sorted(files)])
    return _registry(unique, state, wrong)


_named: list[str] = []


def use_solvers(names: Iterable[str]) -> None:
    """Make CVXPY's solvers of these names methods of every conic Program, for this process.

    Raises
    ------
    UnknownNameError, InputError
        CVXPY does not know a solver, or it is not installed.
    """
    for name in names:
        if name not in _named:
            from workbench.conic import conic_solver

            conic_solver(name)
            _named.append(name)


@cache
def _use_available_solvers(names: tuple[str, ...]) -> tuple[str, ...]:
    """Use a project's solvers; returns a sentence for each one that cannot be used.

    Each is tried once in a process: every search for a problem comes through here.
    """
    wrong = []
    for name in names:
        try:
            use_solvers([name])
        except WorkbenchError as error:
            wrong.append(f"solver {name} of pyproject.toml: {error}")
    return tuple(wrong)


def used_solvers() -> tuple[str, ...]:
    """Names of the solvers used so far."""
    return tuple(_named)


def _points(group: str) -> list[EntryPoint]:
    return sorted(entry_points(group=group), key=lambda point: (point.name, point.value))


@cache
def _package_folders() -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Folders of installed packages that contain problems; no package is imported.

    Also returned: one sentence for each entry point that leads to no folder.
    """
    found, wrong = [], []
    for point in _points("workbench.problems"):
        try:
            spec = find_spec(point.value)
        except (ImportError, ValueError) as error:
            wrong.append(f"entry point {point.name} = {point.value}: {error}")
            continue
        if spec is None or not spec.submodule_search_locations:
            wrong.append(f"entry point {point.name}: {point.value} is no package")
            continue
        found.append(Path(next(iter(spec.submodule_search_locations))))
    return tuple(found), tuple(wrong)


@cache
def _load_packages() -> tuple[str, ...]:
    """Import the modules of installed packages that add solvers and methods.

    Returns one sentence for each module that cannot be imported.
    """
    wrong = []
    for point in _points("workbench.solvers"):
        try:
            point.load()
        except Exception as error:  # a foreign module may raise any error
            words = f"{type(error).__name__}: {error}"
            wrong.append(f"entry point {point.name} = {point.value}: {words}")
    return tuple(wrong)


@lru_cache(maxsize=1)
def _registry(
    roots: tuple[Path, ...], state: tuple[tuple[str, int], ...], wrong: tuple[str, ...]
) -> Registry:
    """The registry, kept until a file is added, removed or edited."""
    return Registry(list(roots), wrong)


RESULTS = "WORKBENCH_RESULTS"


def use_results(folder: str | Path) -> None:
    """Store results in this folder, for the rest of this process and the processes it starts."""
    os.environ[RESULTS] = str(possible_path(folder).resolve())


def results_root() -> Path:
    """The results folder: that of the environment's WORKBENCH_RESULTS, else the project's."""
    override = os.environ.get(RESULTS)
    return Path(override) if override else Project.around(Path.cwd()).results
