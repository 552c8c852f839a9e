"""The registry: the problems of several folders, under one set of names."""

from __future__ import annotations

import fnmatch
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

from workbench.bench.discovery import Entry, method_files, scan
from workbench.bench.problem import Problem, axis_values, import_file
from workbench.errors import InputError, RegistryError, UnknownNameError, WorkbenchError


class Registry:
    """The problems of several folders, under one set of names.

    A file that cannot be read, or a name that two functions claim, affects only its own names:
    ``unfit`` has one sentence for each of these, and those passed in about packages and solvers.
    Files that register methods are imported before the first problem, even for Programs of other
    files.
    """

    def __init__(self, roots: list[Path], wrong: Sequence[str] = ()) -> None:
        self.roots = roots
        self._wrong = list(wrong)
        self._problems: dict[str, Problem] = {}
        self._methods_imported = False

    @cached_property
    def _found(self) -> tuple[dict[str, list[Entry]], list[str]]:
        """Entries by the name that they claim, and errors of files."""
        claims: dict[str, list[Entry]] = {}
        wrong: list[str] = []
        for root in self.roots:
            for one in scan(root, axis_values):
                if isinstance(one, RegistryError):
                    wrong.append(str(one))
                else:
                    claims.setdefault(one.name, []).append(one)
        return claims, wrong

    @cached_property
    def entries(self) -> dict[str, Entry]:
        """Every entry by name, sorted; names that two functions claim are left out."""
        claims = sorted(self._found[0].items())
        return {name: twins[0] for name, twins in claims if len(twins) == 1}

    @cached_property
    def clashes(self) -> dict[str, str]:
        """One sentence for each name that several functions claim."""
        return {
            name: f"two problems are called {name!r}: {' and '.join(one.place for one in twins)}"
            for name, twins in sorted(self._found[0].items())
            if len(twins) > 1
        }

    @property
    def unfit(self) -> list[str]:
        """One sentence for each file that cannot be read, each clash, and each error passed in."""
        return [*self._wrong, *self._found[1], *self.clashes.values()]

    def import_methods(self) -> None:
        """Import the files that register methods, once; a file that fails affects only itself."""
        if self._methods_imported:
            return
        self._methods_imported = True
        for root in self.roots:
            for file in method_files(root):
                try:
                    import_file(root, file)
                except RegistryError as error:
                    self._wrong.append(str(error))

    def match(self, pattern: str) -> list[Entry]:
        """Entries whose name fits a shell pattern.

        Raises
        ------
        UnknownNameError, RegistryError
            No name fits; or one might, if a file could be read or a clash were solved.
        """
        found = [e for name, e in self.entries.items() if fnmatch.fnmatchcase(name, pattern)]
        if not found:
            raise self._unknown(pattern, fnmatch.filter(self.clashes, pattern))
        return found

    def find(self, name: str) -> Problem:
        """The problem of that name, imported. Raises as `match`, and InputError for no text."""
        if not isinstance(name, str):  # `input_checks` takes too long to import for a list of names
            raise InputError(f"the name of a problem must be a str, not {type(name).__name__}")
        if name not in self.entries:
            raise self._unknown(name, [name] if name in self.clashes else [])
        self.import_methods()
        if name not in self._problems:
            self._problems[name] = Problem(self.entries[name])
        return self._problems[name]

    def _unknown(self, name: str, clashing: list[str]) -> WorkbenchError:
        if clashing:
            return RegistryError("; ".join(self.clashes[one] for one in clashing))
        unknown = UnknownNameError("problem", name, self.entries)
        wrong = [*self._wrong, *self._found[1]]
        return RegistryError("; ".join([str(unknown), *wrong])) if wrong else unknown
